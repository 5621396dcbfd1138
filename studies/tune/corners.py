"""The non-linear closed loop with mass, inertia and thrust wrong by a fifth, which the controller is not told."""

from itertools import product
from typing import NamedTuple

import numpy as np

from dynamics import effects
from dynamics.cell import Cell
from dynamics.vehicles import multirotor
from services.autopilot.config import Autopilot
from services.autopilot.gains import Airframe, GainSet, build
from services.plant.models import reduced
from services.scene import Scene
from services.sections import Effects, Exchange, airframe, start_height
from studies.campaign.figures import Figures, figures
from studies.campaign.flight import fly_compiled

WRONG = 0.2  # of the nominal value


class Corner(NamedTuple):
    """Factors on the true vehicle."""

    mass: float
    inertia: float
    thrust: float

    def __str__(self) -> str:
        return ", ".join(f"{name} {100.0 * (value - 1.0):+.0f} %" for name, value in self._asdict().items())


NOMINAL = Corner(1.0, 1.0, 1.0)
CORNERS = [Corner(*signs) for signs in product((1.0 - WRONG, 1.0 + WRONG), repeat=3)]


def flown(scene: Scene, gains: GainSet, known: Airframe, corner: Corner = NOMINAL) -> Figures:
    """Figures of the scene's flight with a gain set; `known` is what the controller is told of the vehicle."""
    controller = build(gains, known, scene[Autopilot].attitude == "so3")
    flight, _ = fly_compiled(scene, _plant(scene, corner), controller)
    return figures(0, flight, scene[Exchange].interval)


def _plant(scene: Scene, corner: Corner) -> reduced.Core:
    """The scene's plant with a vehicle that differs from the nominal one."""
    frame = airframe(scene)
    mass = frame.mass.model_copy(
        update={
            "total": corner.mass * frame.mass.total,
            "inertia": tuple(float(i) for i in corner.inertia * np.array(frame.mass.inertia)),
        }
    )
    frame = frame.model_copy(update={"mass": mass})
    acting = tuple(_stronger(e, corner.thrust) for e in effects.from_scene(scene[Effects].tables, frame))
    p = multirotor.parameters(frame, acting)
    start = multirotor.initial_state(p, (0.0, 0.0, start_height(scene)))
    return reduced.create(scene).core._replace(parameters=Cell(p), state=Cell(start))


def _stronger(effect: tuple, factor: float) -> tuple:
    """An effect whose rotors give `factor` times the thrust; others as they are."""
    if "thrust_constant" not in getattr(effect, "_fields", ()):
        return effect
    return effect._replace(thrust_constant=factor * effect.thrust_constant)  # type: ignore[attr-defined]
