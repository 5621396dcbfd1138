"""Errors of solvers in a scene's own flight: they repeat the commands that it records with a reference solver."""

import math
from collections.abc import Iterable

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.run_errors import DivergedError
from lapwing.cosim.scene import Scene
from lapwing.dynamics import integrators
from lapwing.services.common.firmware.schema import flown_by_firmware
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.plant.schema import LEAST_ACCURACIES
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy import plant
from lapwing.studies.accuracy.open_loop import fly_parts, starts_of_parts
from lapwing.studies.accuracy.state_errors import TOPICS, differences_of_all, worst_of
from lapwing.studies.accuracy.work_precision import Point, cheapest
from lapwing.studies.simulate import fly_with_ports

REFERENCE, FINEST = "rk8_renormalised", 32  # integrator, steps in a communication step
STRICTER = 1e-3  # factor of the accuracy in contact, in the reference
STRICTEST = LEAST_ACCURACIES["ground_contact"]  # limit of the accuracy in contact by round-off
LONGEST = 200.0  # [s] of all vehicles together
CANDIDATES = ("rk4_renormalised", "rkmk54", "rk8_renormalised")  # rkmk2 was the cheapest in no flight
DIVISORS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32)  # steps in a communication step
MARGIN = 1.1  # accuracy over the error, for random numbers and a closed loop that differ from the reference's
GAIN = 2  # largest excess of the observed order over that of the method


class OwnFlight:
    """Flight of a scene with the reference solver."""

    def __init__(self, scene: Scene, accuracy: float):
        """Fly the scene.

        Args:
            scene: scene with known commands, see `has_known_commands`.
            accuracy: its smallest `solver.accuracy`.

        Raises:
            ValueError: the flight fails, or does not end within `LONGEST`.
        """
        reference = reference_config(scene, accuracy)
        self._scene, self.interval = scene, reference.interval
        most = round(LONGEST / len(scene.each_vehicle) / self.interval)
        flights, diagram = fly_with_ports(reference._replace(last_tick=min(reference.last_tick, most)), TOPICS)
        if failure := next((flight.failure for flight in flights if flight.failure), ""):
            raise ValueError(failure)
        if most < reference.last_tick and not diagram.ended:
            raise ValueError(f"{scene.path}: longer than {LONGEST:g} s")
        self._flights, self._diagram, self._starts = flights, diagram, starts_of_parts(diagram)
        self._uncertainty = self._difference(reference_config(scene, accuracy, FINEST // 2))  # of the reference

    def error(self, integrator: str, steps: int) -> float:
        """Return a bound of the error of an integrator with `steps` in a communication step, in parts of the flight.

        It includes the difference of the reference from itself with half as many steps, because a kink in a force
        reduces the order. It is infinite if the state becomes invalid.
        """
        return self._difference(_config(self._scene, integrator, steps)) + self._uncertainty

    def _difference(self, config: RunConfig) -> float:
        """Return the largest difference of another solver from the reference."""
        config = config._replace(last_tick=self._diagram.tick - 1)
        try:
            parts = fly_parts(self._diagram, self._starts, config, TOPICS)
        except DivergedError:
            return math.inf
        return worst_of(q for part in parts for q in differences_of_all(self._flights, part.flights, part.spans)).error

    def cheapest(self, names: Iterable[str], accuracy: float) -> Point:
        """Return the solver of least work that meets the accuracy with the margin, or if none does, without.

        Args:
            names: names of the integrators.
            accuracy: largest error.

        Raises:
            ConfigError: no solver meets the accuracy.
        """
        longest = min(plant.longest_step(vehicle) for vehicle in self._scene.each_vehicle)
        candidates = []
        for method in map(integrators.get, names):
            name, per_step = method.__name__.rpartition(".")[2], getattr(method, "EVALUATIONS", None)
            candidates += [
                Point(name, method.ORDER, "s", step, math.inf, math.nan, per_step and n * per_step, {})
                for n in DIVISORS
                if (step := self.interval / n) <= longest
            ]
        points: list[Point] = []
        for point in sorted(candidates, key=lambda p: p.work):
            longer, steps = [p for p in points if p.method == point.method], round(self.interval / point.setting)
            hopeless = any(p.error * (point.setting / p.setting) ** (p.order + GAIN) > accuracy for p in longer)
            if hopeless and steps < DIVISORS[-1]:
                continue
            points.append(point._replace(error=self.error(point.method, steps)))
            if points[-1].error <= accuracy / MARGIN:
                return points[-1]
        return cheapest(points, accuracy)


def has_known_commands(scene: Scene) -> bool:
    """Return True for a scene of multirotors without a foreign firmware and without commands from outside."""
    return all(
        hasattr(plant.model(vehicle), "describe")
        and not flown_by_firmware(vehicle)
        and not vehicle.lookup("autopilot.accept_commands")
        for vehicle in scene.each_vehicle
    )


def reference_config(scene: Scene, accuracy: float, steps: int = FINEST) -> RunConfig:
    """Return the run configuration of a scene with the reference solver for an accuracy."""
    return _config(scene, REFERENCE, steps, f"solver.accuracy={max(STRICTER * accuracy, STRICTEST)!r}")


def _config(scene: Scene, integrator: str, steps: int, *more: str) -> RunConfig:
    step = scene.each_vehicle[0][Communication].interval / steps
    return resolve(load(scene, [f"solver.integrator={integrator}", f"solver.step={step!r}", *more]))
