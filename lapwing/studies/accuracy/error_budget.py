"""Error budget of a flight: solver step, ground contact, communication step, coupling.

The scene is flown in memory, closed loop, each time with one of the four changed. Sensors and random winds would hide
what is looked for: the autopilot gets the true state, and winds their mean.
"""

import math
from typing import NamedTuple

import numpy as np

from lapwing.cosim.scene import Scene
from lapwing.messages.topics import TRUTH
from lapwing.services.common.communication_schema import Communication, Rates
from lapwing.services.common.run_schema import Run
from lapwing.services.scene_resolver import load
from lapwing.studies.accuracy.plant import longest_step
from lapwing.studies.flight_data import FlightData
from lapwing.studies.simulate import fly

LONGEST = 20.0  # [s] of a motion without an end
WHOLE = 200.0  # [s] of a mission, from take-off to rest
MOST_TICKS = 5000  # of the former, at the scene's own rate
SOURCES = ("plant step", "contact", "exchange interval", "coupling delay")
ACCURACIES = (1e-3, 1e-4, 1e-5, 1e-6)  # asked of the contact
FINEST_ACCURACY = 1e-9  # of the contact, in whatever else is compared
STEPS = (1, 2, 4, 8)  # in an exchange interval, of the scene's integrator
FINEST_STEPS = 32  # in the scene's exchange interval, of rkmk4
FINER = (1, 2, 4)  # times the scene's exchange rate
MOST = 0.9  # of the ticks
FINEST_RATE = 8  # times that rate, of what the others are compared with


class Part(NamedTuple):
    """One source of error at one setting: differences that nine ticks in ten of the flight stay below, and the largest.

    The largest is often that of the one tick in which the vehicle touches down a moment sooner or later.
    """

    source: str
    setting: float  # [s] step, or exchange interval; of the contact the accuracy
    label: str
    position: float  # [m]
    attitude: float  # [rad]
    largest_position: float  # [m]


def errors(scene: Scene) -> list[Part]:
    """Return the errors of a scene with a given integrator and step, each at several settings.

    Raises:
        ValueError: a flight does not end.
    """
    base = [*scene.overrides, *_clean(scene), f"run.duration={_duration(scene)!r}"]
    rate, interval = scene[Communication].rate, scene[Communication].interval

    def flight_with(factor: int, coupling: str, solver: list[str]) -> FlightData:
        settings = [*base, *_exchange(scene, rate * factor), f"communication.coupling={coupling}", *solver]
        flight: FlightData = fly(load(scene.path, settings), (TRUTH,))
        if flight.failure:
            raise ValueError(f"{scene.path}: {flight.failure}")
        return flight

    def fine(factor: int, accuracy: float = FINEST_ACCURACY) -> list[str]:
        step = interval / max(FINEST_STEPS, factor)
        return ["solver.integrator=rkmk4", f"solver.step={step!r}", f"solver.accuracy={accuracy!r}"]

    coupling = scene[Communication].coupling
    parts = []
    exact = flight_with(1, coupling, fine(1))
    for step in (interval / n for n in STEPS if interval / n <= longest_step(scene)):
        flight = flight_with(1, coupling, [f"solver.step={step!r}", f"solver.accuracy={FINEST_ACCURACY!r}"])
        parts.append(_part(SOURCES[0], step, f"{scene_integrator(scene)}, step {1e3 * step:g} ms", flight, exact))
    for accuracy in ACCURACIES if touches(scene) else ():
        flight = flight_with(1, coupling, fine(1, accuracy))
        parts.append(_part(SOURCES[1], accuracy, f"accuracy {accuracy:g}", flight, exact))
    sequential = {factor: flight_with(factor, "gauss_seidel", fine(factor)) for factor in (*FINER, FINEST_RATE)}
    for factor in FINER:
        label = f"{rate * factor} Hz"
        parts.append(_part(SOURCES[2], interval / factor, label, sequential[factor], sequential[FINEST_RATE]))
    for factor in FINER:
        label = f"Jacobi at {rate * factor} Hz"
        parallel = flight_with(factor, "jacobi", fine(factor))
        parts.append(_part(SOURCES[3], interval / factor, label, parallel, sequential[factor]))
    return parts


def scene_integrator(scene: Scene) -> str:
    """Return the name of the scene's integrator."""
    return str(scene.lookup("solver.integrator"))


def touches(scene: Scene) -> bool:
    """Return True if the scene's vehicle can touch the ground."""
    return "ground_contact" in scene.tables("effects")


def _duration(scene: Scene) -> float:
    if touches(scene):
        return min(scene[Run].duration, WHOLE)
    interval = scene[Communication].interval
    return min(scene[Run].duration, max(min(LONGEST, MOST_TICKS * interval), 1000 * interval))


def _clean(scene: Scene) -> list[str]:
    """Return the overrides that remove noise."""
    result = ["autopilot.estimator=ground_truth"] if scene.has("autopilot") else []
    if "random_wind_force" in scene.tables("effects"):
        result.append("effects.random_wind_force.sigma=0.0")
    return result


def _exchange(scene: Scene, rate: int) -> list[str]:
    """Return the overrides for another communication rate; what is due at every tick stays so."""
    bodies = [f"rates.body_states={rate}"] if scene[Rates].body_states == scene[Communication].rate else []
    return [f"communication.rate={rate}", *bodies]


def _part(source: str, setting: float, label: str, flight: FlightData, exact: FlightData) -> Part:
    return Part(source, setting, label, *difference(flight, exact))


def difference(one: FlightData, other: FlightData) -> tuple[float, float, float]:
    """Return the 90th percentiles of distance [m] and angle [rad] between two flights, and the maximum distance.

    Compared at the ticks of the flight with fewer ticks.
    """
    coarse, fine = (one, other) if one.setup.interval >= other.setup.interval else (other, one)
    every = round(coarse.setup.interval / fine.setup.interval)
    n = min(len(coarse.truth), -(-len(fine.truth) // every))
    p, q = coarse.truth.position[:n], coarse.truth.orientation[:n]
    r, s = fine.truth.position[::every][:n], fine.truth.orientation[::every][:n]
    # twice the arc sine of half the chord: exact for small angles, where the arc cosine is not
    chord = np.minimum(np.linalg.norm(q - s, axis=1), np.linalg.norm(q + s, axis=1))
    angle = 4.0 * np.arcsin(np.minimum(0.5 * chord, math.sqrt(0.5)))
    distance = np.linalg.norm(p - r, axis=1)
    return float(np.quantile(distance, MOST)), float(np.quantile(angle, MOST)), float(distance.max())
