"""Errors of solvers in a scene's own flight: they repeat the commands that it records with a reference solver."""

import math

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.run_errors import DivergedError
from lapwing.cosim.scene import Scene
from lapwing.services.common.firmware.schema import flown_by_firmware
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.plant.schema import LEAST_ACCURACIES
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy import plant
from lapwing.studies.accuracy.open_loop import fly_parts, starts_of_parts
from lapwing.studies.accuracy.state_errors import TOPICS, Quantity, differences_of_all, worst_of
from lapwing.studies.simulate import fly_with_ports

REFERENCE, FINEST = "rk8_renormalised", 32  # integrator, steps in a communication step
STRICTER = 1e-3  # factor of the accuracy in contact, in the reference
STRICTEST = LEAST_ACCURACIES["ground_contact"]  # limit of the accuracy in contact by round-off
LONGEST = 200.0  # [s] of all vehicles together


class OwnFlight:
    """Flight of a scene with the reference solver."""

    def __init__(self, scene: Scene, reference: RunConfig):
        """Fly the scene.

        Args:
            scene: scene with known commands, see `has_known_commands`.
            reference: its `reference_config`.

        Raises:
            ValueError: the flight fails, or does not end within `LONGEST`.
        """
        self._scene, self.interval = scene, reference.interval
        most = round(LONGEST / len(scene.each_vehicle) / self.interval)
        flights, diagram = fly_with_ports(reference._replace(last_tick=min(reference.last_tick, most)), TOPICS)
        if failure := next((flight.failure for flight in flights if flight.failure), ""):
            raise ValueError(failure)
        if most < reference.last_tick and not diagram.ended:
            raise ValueError(f"{scene.path}: longer than {LONGEST:g} s")
        self._flights, self._diagram, self._starts = flights, diagram, starts_of_parts(diagram)

    def error(self, integrator: str, steps: int) -> Quantity:
        """Return the largest error of an integrator with `steps` in a communication step, in parts of the flight.

        It is infinite if the state becomes invalid.
        """
        config = _config(self._scene, integrator, steps)._replace(last_tick=self._diagram.tick - 1)
        try:
            parts = fly_parts(self._diagram, self._starts, config, TOPICS)
        except DivergedError as error:
            return Quantity(self._flights[0].vehicle, str(error), math.inf, 0.0)
        return worst_of(q for part in parts for q in differences_of_all(self._flights, part.flights, part.spans))


def has_known_commands(scene: Scene) -> bool:
    """Return True for a scene of multirotors without a foreign firmware and without commands from outside."""
    return all(
        hasattr(plant.model(vehicle), "describe")
        and not flown_by_firmware(vehicle)
        and not vehicle.lookup("autopilot.accept_commands")
        for vehicle in scene.each_vehicle
    )


def reference_config(scene: Scene, accuracy: float) -> RunConfig:
    """Return the run configuration of a scene with the reference solver for an accuracy."""
    return _config(scene, REFERENCE, FINEST, f"solver.accuracy={max(STRICTER * accuracy, STRICTEST)!r}")


def _config(scene: Scene, integrator: str, steps: int, *more: str) -> RunConfig:
    step = scene.each_vehicle[0][Communication].interval / steps
    return resolve(load(scene, [f"solver.integrator={integrator}", f"solver.step={step!r}", *more]))
