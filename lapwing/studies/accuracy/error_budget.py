"""Error budget of a flight: solver step, ground contact, communication step, coupling, held quantities.

The scene is flown in memory in closed loop, each time with one of the first four changed. The autopilot receives the
ground truth, and winds have their mean values, because noise would hide the errors. Quantities that the plant holds
over a communication step are measured without the control loop: the plant is repeated under the recorded commands, with
more updates while each command acts as long as before. In a fleet these are mostly the states of neighbours, which
name the source there; errors are the largest of all vehicles.
"""

import math
from typing import NamedTuple

import numpy as np

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.scene import Scene
from lapwing.dynamics.effects import parameter_class
from lapwing.dynamics.effects._vehicle_interaction import INTERACTION
from lapwing.flights.flight_data import FlightData
from lapwing.messages.topics import TRUTH
from lapwing.services.common.schemas.communication_schema import Communication, Rates
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.plant.schema import Solver
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy.open_loop import Parts, Start, fly_parts, inputs_of_plant, starts_of_parts
from lapwing.studies.accuracy.plant import longest_step
from lapwing.studies.simulate import fly_each, fly_with_ports

MAX_DURATION = 20.0  # [s] of a scene without contact
MAX_MISSION = 200.0  # [s] of a scene with contact, from take-off to rest
MAX_TICKS = 5000  # ticks of a scene without contact
SOURCES = ("plant step", "contact", "communication step", "coupling delay", "held quantities")
ACCURACIES = (1e-3, 1e-4, 1e-5, 1e-6)  # accuracies of the contact
REFERENCE_ACCURACY = 1e-9  # of the contact, in all other comparisons
STEPS = (1, 2, 4, 8)  # steps of the scene's integrator per communication step
REFERENCE_STEPS = 32  # steps of rkmk4 per communication step
RATE_FACTORS = (1, 2, 4)  # multiples of the scene's communication rate
QUANTILE = 0.9  # of the differences over the ticks
REFERENCE_RATE = 8  # multiple of that rate in the reference


class ErrorSource(NamedTuple):
    """Error by one source at one setting: 90th percentiles over the ticks, and the largest position error.

    The largest error often belongs to a single tick at touchdown, whose time differs.
    """

    source: str
    setting: float  # [s] step or communication step; accuracy of the contact
    label: str
    position: float  # [m]
    attitude: float  # [rad]
    largest_position: float  # [m]


def errors(scene: Scene) -> list[ErrorSource]:
    """Return the error sources of a scene, each at several settings.

    Raises:
        ValueError: a flight fails.
    """
    base = [*scene.overrides, *noise_overrides(scene), f"run.duration={_duration(scene)!r}"]
    rate, interval = scene[Communication].rate, scene[Communication].interval

    def flight_with(factor: int, coupling: str, solver: list[str]) -> list[FlightData]:
        settings = [*base, *rate_overrides(scene, rate * factor), f"communication.coupling={coupling}", *solver]
        flights = fly_each(load(scene.path, settings), (TRUTH,))
        if failure := flights[0].failure:
            raise ValueError(f"{scene.path}: {failure}")
        return flights

    def fine_solver(factor: int, accuracy: float = REFERENCE_ACCURACY) -> list[str]:
        step = interval / max(REFERENCE_STEPS, factor)
        return ["solver.integrator=rkmk4", f"solver.step={step!r}", f"solver.accuracy={accuracy!r}"]

    def updated(diagram: BlockDiagram, starts: list[Start], factor: int) -> tuple[Parts, Parts]:
        settings = [*base, *rate_overrides(scene, rate * factor), *fine_solver(factor)]
        config = resolve(load(scene.path, settings))
        return fly_parts(diagram, starts, config._replace(last_tick=factor * diagram.tick - 1), (TRUTH,))

    coupling = scene[Communication].coupling
    parts = []
    exact = flight_with(1, coupling, fine_solver(1))
    longest = min(longest_step(vehicle) for vehicle in scene.each_vehicle)
    for step in (interval / n for n in STEPS if interval / n <= longest):
        flight = flight_with(1, coupling, [f"solver.step={step!r}", f"solver.accuracy={REFERENCE_ACCURACY!r}"])
        label = f"{scene.each_vehicle[0][Solver].integrator}, step {1e3 * step:g} ms"
        parts.append(_error_source(SOURCES[0], step, label, flight, exact))
    for accuracy in ACCURACIES if has_contact(scene) else ():
        flight = flight_with(1, coupling, fine_solver(1, accuracy))
        parts.append(_error_source(SOURCES[1], accuracy, f"accuracy {accuracy:g}", flight, exact))
    sequential = {
        factor: flight_with(factor, "gauss_seidel", fine_solver(factor)) for factor in (*RATE_FACTORS, REFERENCE_RATE)
    }
    finest = sequential[REFERENCE_RATE]
    for factor in RATE_FACTORS:
        label = f"{rate * factor} Hz"
        parts.append(_error_source(SOURCES[2], interval / factor, label, sequential[factor], finest))
    for factor in RATE_FACTORS:
        label = f"Jacobi at {rate * factor} Hz"
        parallel = flight_with(factor, "jacobi", fine_solver(factor))
        parts.append(_error_source(SOURCES[3], interval / factor, label, parallel, sequential[factor]))
    _, diagram = fly_with_ports(resolve(load(scene.path, [*base, *fine_solver(1)])), (TRUTH,))
    if inputs_of_plant(diagram):
        source = "neighbours" if acting_on_neighbours(scene) else SOURCES[4]
        starts = starts_of_parts(diagram)
        reference, _ = updated(diagram, starts, REFERENCE_RATE)
        for factor in RATE_FACTORS:
            one, _ = updated(diagram, starts, factor)
            label = f"updates at {rate * factor} Hz"
            parts.append(_error_source(source, interval / factor, label, one.flights, reference.flights))
    return parts


def largest(scene: Scene, parts: list[ErrorSource]) -> ErrorSource | None:
    """Return the largest error source at the scene's communication step; that of solver and contact at the coarsest."""
    coarsest = {part.source: part for part in reversed(parts)}
    if scene[Communication].coupling == "gauss_seidel":
        coarsest.pop(SOURCES[3], None)
    return max(coarsest.values(), key=lambda part: (part.position, part.attitude), default=None)


def has_contact(scene: Scene) -> bool:
    """Return True if a vehicle of the scene can touch the ground."""
    return any("ground_contact" in vehicle.tables("effects") for vehicle in scene.each_vehicle)


def acting_on_neighbours(scene: Scene) -> list[str]:
    """Return the names of the effects by which the vehicles of a fleet act on each other."""
    tables = [vehicle.tables("effects") for vehicle in scene.vehicles]
    names = {name for own in tables for name, t in own.items() if parameter_class(name, t.get("module")) in INTERACTION}
    return sorted(names) if len(tables) > 1 else []


def _duration(scene: Scene) -> float:
    if has_contact(scene):
        return min(scene[Run].duration, MAX_MISSION)
    interval = scene[Communication].interval
    return min(scene[Run].duration, max(min(MAX_DURATION, MAX_TICKS * interval), 1000 * interval))


def noise_overrides(scene: Scene) -> list[str]:
    """Return the overrides that remove noise."""
    vehicles = scene.each_vehicle
    result = ["autopilot.estimator=ground_truth"] if all(vehicle.has("autopilot") for vehicle in vehicles) else []
    if all("random_wind_force" in vehicle.tables("effects") for vehicle in vehicles):
        result.append("effects.random_wind_force.sigma=0.0")
    return result


def rate_overrides(scene: Scene, rate: int) -> list[str]:
    """Return the overrides for another communication rate; topics due at every tick remain so."""
    bodies = [f"rates.body_states={rate}"] if scene[Rates].body_states == scene[Communication].rate else []
    return [f"communication.rate={rate}", *bodies]


def _error_source(
    source: str, setting: float, label: str, flights: list[FlightData], exact: list[FlightData]
) -> ErrorSource:
    """Return the largest errors of all vehicles."""
    errors_of_each = [difference(*pair) for pair in zip(flights, exact, strict=True)]
    return ErrorSource(source, setting, label, *map(max, zip(*errors_of_each, strict=True)))


def difference(one: FlightData, other: FlightData) -> tuple[float, float, float]:
    """Return the 90th percentiles of distance [m] and angle [rad] between two flights, and the maximum distance.

    They are compared at the ticks of the flight with fewer ticks.
    """
    coarse, fine = (one, other) if one.config.interval >= other.config.interval else (other, one)
    stride = round(coarse.config.interval / fine.config.interval)
    n = min(len(coarse.truth), -(-len(fine.truth) // stride))
    p, q = coarse.truth.position[:n], coarse.truth.orientation[:n]
    r, s = fine.truth.position[::stride][:n], fine.truth.orientation[::stride][:n]
    # twice the arc sine of half the chord, which is accurate for small angles, unlike the arc cosine
    chord = np.minimum(np.linalg.norm(q - s, axis=1), np.linalg.norm(q + s, axis=1))
    angle = 4.0 * np.arcsin(np.minimum(0.5 * chord, math.sqrt(0.5)))
    distance = np.linalg.norm(p - r, axis=1)
    return float(np.quantile(distance, QUANTILE)), float(np.quantile(angle, QUANTILE)), float(distance.max())
