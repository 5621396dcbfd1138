"""Closed-loop flights with deviations of 20 % in mass, inertia and thrust from the controller's model."""

from collections.abc import Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.scene import Scene
from lapwing.dynamics import effects
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.ground_equilibrium import static_equilibrium
from lapwing.flights.metrics import metrics
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.common.autopilot_parameters import gain_parameters
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import Effects, airframe, gravity, start_pose
from lapwing.studies.campaign.campaign_config import TOPICS
from lapwing.studies.simulate import fly

DEVIATION = 0.2  # of the nominal value


class Corner(NamedTuple):
    """Factors of the true vehicle relative to the autopilot's model."""

    mass: float
    inertia: float
    thrust: float

    def __str__(self) -> str:
        return ", ".join(f"{name} {100.0 * (value - 1.0):+.0f} %" for name, value in self._asdict().items())


CORNERS = [Corner(*signs) for signs in product((1.0 - DEVIATION, 1.0 + DEVIATION), repeat=3)]


def metrics_of(config: RunConfig) -> dict[str, Any]:
    """Return the metrics of a flight."""
    return metrics(fly(config, TOPICS))


def failure(flight: Mapping[str, Any]) -> str:
    """Return the outcome of a flight that failed, from its metrics; "" if it succeeded."""
    return "" if flight["outcome"] in ("landed", "completed") else str(flight["outcome_text"])


def with_gains(config: RunConfig, gains: GainSet) -> RunConfig:
    """Return the run with another gain set, which also replaces gains changed by the scene's parameters."""
    present, changed = config.services["autopilot"].parameters, {p.name: p for p in gain_parameters(gains)}
    parameters = tuple(changed.get(p.name, p) for p in present.parameters)
    return _with(config, "autopilot", present._replace(gains=gains.plain(), parameters=parameters))


def with_vehicle(config: RunConfig, scene: Scene, corner: Corner) -> RunConfig:
    """Return the run with a vehicle that differs from the autopilot's model."""
    frame = airframe(scene)
    mass = frame.mass.model_copy(
        update={
            "total": corner.mass * frame.mass.total,
            "inertia": tuple(float(i) for i in corner.inertia * np.array(frame.mass.inertia)),
            "products": tuple(float(i) for i in corner.inertia * np.array(frame.mass.products)),
        }
    )
    frame = frame.model_copy(update={"mass": mass})
    active = effects.from_scene(scene[Effects].tables, frame, environment(scene))
    modified = tuple(_stronger(e, corner.thrust) for e in active)
    p = multirotor.parameters(frame, modified)
    plant = config.services["plant"].parameters
    start = plant.start._replace(vehicle=static_equilibrium(multirotor, p, start_pose(scene), gravity(scene)))
    return _with(config, "plant", plant._replace(core=plant.core._replace(vehicle=p), start=start))


def _with(config: RunConfig, name: str, parameters: Any) -> RunConfig:
    changed = config.services[name]._replace(parameters=parameters)
    return config._replace(services={**config.services, name: changed})


def _stronger(effect: Any, factor: float) -> Any:
    """Return an effect with its thrust constant times `factor`; unchanged if it has none."""
    if "thrust_constant" not in getattr(effect, "_fields", ()):
        return effect
    return effect._replace(thrust_constant=factor * effect.thrust_constant)
