"""Stability cases that several simulators run: free rigid bodies, and a vehicle with balls as feet on a plane."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol

import numpy as np

from benchmarks._simulators import Errors
from lapwing.studies.stability.cases import intermediate_axis, landing, looping, odd_inertia, slopes, toppling
from lapwing.studies.stability.sampled_runs import drift

# (inertia [kg m^2], start, duration [s], steps, samples) -> R_world_body and omega_body, shape (samples + 1, 12)
March = Callable[[Any, Any, float, int, int], np.ndarray]
Cases = dict[str, Callable[[], Errors]]

RADIUS = 0.01  # [m] radius of the ball of a foot
BALLS = [(x, y, z + RADIUS) for x, y, z in toppling.FEET]  # [m] centres of the balls, body frame


class Vehicle(Protocol):
    """The delivery drone on four balls at rest, on a plane that rises along y."""

    def run_on(self, seconds: float) -> None:
        """Advance the simulation."""

    def attitude_matrix(self) -> np.ndarray:
        """Return R_world_body, shape (3, 3)."""

    def position_world(self) -> np.ndarray:
        """Return the position [m], shape (3,)."""

    def velocity_world(self) -> np.ndarray:
        """Return the velocity [m/s], shape (3,)."""

    def push(self, velocity_world: list[float]) -> None:
        """Set the velocity [m/s]."""

    def put(self, height: float, attitude: tuple[float, ...]) -> None:
        """Set the height [m] and the attitude (quaternion wxyz)."""


def free_body_cases(methods: Mapping[str, March]) -> Cases:
    """Return the cases of free bodies for methods by their displayed names."""

    def tumbling() -> Errors:
        c = intermediate_axis
        result: dict[str, dict[str, float]] = {"rates": {}, "energy": {}, "momentum": {}}
        for name, march in methods.items():
            y = march(c.INERTIA, c.initial_state(c.EPSILON), c.DURATION, c.STEPS, c.SAMPLES)
            for row, values in zip(result, c.figures_of_run(y, c.EPSILON), strict=True):
                result[row][name] = float(values.max())
        return result

    def loops() -> Errors:
        c = looping

        def error(march: March) -> float:
            y = march(c.INERTIA, c.initial_state(c.OFFSET), c.DURATION, c.STEPS, c.SAMPLES)
            return float(drift(c.momentum(y)).max())

        return {"momentum": {name: error(march) for name, march in methods.items()}}

    def odd_bodies() -> Errors:
        c = odd_inertia

        def error(march: March, inertia: Any, omega: Any) -> float:
            y = march(inertia, c.RigidBody(c.ATTITUDE, omega), c.DURATION, c.STEPS, c.SAMPLES)
            return float(c.drifts_of_run(y, inertia).max())

        return {
            name: {method: error(march, *body) for method, march in methods.items()} for name, body in c.BODIES.items()
        }

    return {"intermediate_axis": tumbling, "looping": loops, "odd_inertia": odd_bodies}


def vehicle_cases(method: str, create: Callable[[float, float], Vehicle]) -> Cases:
    """Return the cases of a vehicle; `create` takes the angle of the plane [rad] and the coefficient of friction."""

    def creep_distance(angle: float, seconds: float) -> float:
        """Return the distance [m] that it moves on a slope [rad] after 3 s at rest."""
        vehicle = create(angle, slopes.STATIC)
        vehicle.run_on(3.0)
        before = vehicle.position_world()
        vehicle.run_on(seconds)
        return float(np.linalg.norm(vehicle.position_world() - before))

    def standing() -> Errors:
        """Return the creep on a slope, and the motion after a slide."""
        vehicle = create(0.0, slopes.DYNAMIC)
        vehicle.run_on(3.0)
        vehicle.push([1.0, 0.0, 0.0])
        vehicle.run_on(2.0)
        left = float(np.abs(vehicle.velocity_world()).max())
        return {"creep": {method: creep_distance(math.radians(20.0), 600.0)}, "stick_slip": {method: left}}

    def sliding() -> Errors:
        """Return the motion below and above the friction angle."""
        a = math.radians(30.0)
        vehicle = create(a, slopes.DYNAMIC)
        vehicle.run_on(0.3)
        early = vehicle.velocity_world()
        vehicle.run_on(0.5)
        exact = landing.G * (math.sin(a) - slopes.DYNAMIC * math.cos(a))
        off = abs(float(np.linalg.norm(vehicle.velocity_world() - early)) / 0.5 / exact - 1.0)
        below = creep_distance(math.radians(slopes.EDGE - slopes.MARGIN), 60.0)
        return {"below": {method: below}, "beyond": {method: off}}

    def falls(axis: int, angle: float) -> bool:
        vehicle = create(0.0, slopes.STATIC)
        vehicle.put(*set_down(axis, angle))
        vehicle.run_on(toppling.SECONDS)
        return bool(vehicle.attitude_matrix()[2, 2] < math.cos(toppling.edge(axis)))  # tilted beyond the edge

    return {"landing": standing, "slopes": sliding, "toppling": lambda: {"leaning": {method: toppling_error(falls)}}}


def set_down(axis: int, angle: float) -> tuple[float, tuple[float, float, float, float]]:
    """Return height [m] and attitude of the vehicle tilted by an angle [rad] with two balls in contact."""
    height = toppling.base(axis) * math.sin(angle) + (landing.HEIGHT - RADIUS) * math.cos(angle) + RADIUS
    x, y, z = (math.sin(0.5 * angle) * u for u in toppling.unit(axis))
    return height, (math.cos(0.5 * angle), x, y, z)


def toppling_error(falls: Callable[[int, float], bool]) -> float:
    """Return the error of the toppling angle [rad] of a tilted vehicle, the larger of both axes.

    A ball touches below its centre: the edge is that of the centres.
    """
    result = []
    for axis in toppling.AXES:
        exact = math.atan(toppling.base(axis) / (landing.HEIGHT - RADIUS))
        at = toppling.threshold(partial(falls, axis), exact - 0.1, exact + 0.1, 34)
        result.append(abs(at - exact))
    return max(result)
