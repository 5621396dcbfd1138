"""Tumbling delivery drone with propellers at constant speed: one rigid body, and five in every description.

The methods are models and stabilisations as in `vehicle.model`, all under RK4 with the same steps. At small steps the
error of a reduced model is its model error: "mean" uses the propellers' inertia averaged over a turn, the other one
only the inertia of the frame, as in the paper.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import types
from scipy.integrate import solve_ivp

from lapwing.dynamics import effects, integrators
from lapwing.dynamics.effects._types import Motion, body_of
from lapwing.dynamics.lie.quaternion import NO_ROTATION, exp, rotation_matrix
from lapwing.dynamics.multibody import five_body_stabilisation
from lapwing.dynamics.multibody.five_bodies import BodyState, FiveBodies
from lapwing.dynamics.multibody.five_bodies import machine as five_bodies_machine
from lapwing.dynamics.vehicles import multirotor, multirotor_euler, multirotor_multibody
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor import advance
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorState, StepInputs, motion_of
from lapwing.dynamics.vehicles.multirotor_euler import FiveEulerBodies
from lapwing.dynamics.vehicles.multirotor_multibody_equations import without_loads
from lapwing.kernels import kernel
from lapwing.kernels.codegen import generic
from lapwing.kernels.state_tree import flatten
from lapwing.studies.accuracy.coordinates import coordinates
from lapwing.studies.accuracy.problem import Problem, SolverMethod, SolverRun
from lapwing.studies.accuracy.reference import TOLERANCE, attitude_rate

AIRFRAME = Path(__file__).parents[3] / "scenes/vehicles/delivery_drone.toml"
DURATION, SAMPLES, COARSEST, HALVINGS = 2.0, 8, 64, 10
SPEED = 100.0  # [rad/s] of the propellers, slow to show the influence of their unequal moments
ATTITUDE, OMEGA = exp((0.2, -0.4, 0.1)), (1.0, -0.7, 0.4)
METHOD = integrators.get("rk4_renormalised")
ZERO = (0.0, 0.0, 0.0)


@kernel
def _violation_of_one(p: Any, x: Any) -> float:
    q = x.attitude
    return abs(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z - 1.0)


@kernel
def _violation_of_five(p: Any, x: Any) -> float:
    u = StepInputs(p, p.body, (), p.layout.x_body)
    return five_body_stabilisation.constraint_violation(without_loads(u, motion_of(p.layout, x)), x)[0]


@kernel
def _violation_of_euler(p: Any, x: Any) -> float:
    return _violation_of_five(p, multirotor_euler.five(x))


@generic()
def constraint_violation(p: types.Type, x: types.Type) -> Any:
    """Return the violation of the constraints [m, -]."""
    return {Motion: _violation_of_one, FiveBodies: _violation_of_five, FiveEulerBodies: _violation_of_euler}[
        x.instance_class
    ]


@kernel
def flight(method: Any, p: Any, state: Any, volts: tuple[float, ...], h: float, n: int, out: np.ndarray) -> float:
    """Fly intervals of n steps of h [s], stored in rows of `out`. Return the final violation of the constraints."""
    for row in range(out.shape[0]):
        if row > 0:
            state = advance(method, p, (0, 0), row - 1, state, volts, h, n)
        numbers = flatten(motion_of(p.layout, state.motion))
        for i in range(len(numbers)):
            out[row, i] = numbers[i]
    return constraint_violation(p, state.motion)


def problems() -> dict[str, Problem]:
    """Return the problem of this file: the delivery drone, in the air and tumbling, as one rigid body and as five."""
    frame = load_airframe(AIRFRAME)
    gyro = effects.from_scene({"gyroscopic_torque": {}}, frame)
    volts = (SPEED * frame.motor.rotor_constant,) * 4
    plain = multirotor.parameters(frame, gyro)
    start = multirotor.initial_state(plain, ZERO, ATTITUDE, SPEED)
    start = start._replace(motion=start.motion._replace(omega_body=OMEGA))
    mean = plain._replace(body=body_of(frame.mass.total, tuple(np.diag(inertia(frame, None)).tolist())))
    methods = [
        _solver_method("reduced, frame only", plain, start, volts),
        _solver_method("reduced, mean", mean, start, volts),
    ]
    for name, formulation in (("SE(3)", multirotor_multibody), ("Euler", multirotor_euler)):
        for stabilisation in multirotor_multibody.STABILISATIONS:
            p = formulation.parameters(frame, (), "speed", stabilisation)
            x = initial_bodies(p, frame)
            state = MultirotorState(x if formulation is multirotor_multibody else multirotor_euler.of_five(x), ())
            methods.append(_solver_method(f"{name}, {stabilisation}", p, state, volts))
    problem = Problem(
        "delivery drone of one and of five bodies, tumbling",
        DURATION,
        methods,
        lambda: reference(frame),
        f"SciPy DOP853 at {TOLERANCE:g} on the conserved angular momentum of five bodies, independent equations",
    )
    return {"delivery_drone": problem}


def initial_bodies(p: Any, frame: Any) -> FiveBodies:
    """Return the initial state of the five bodies, with blades along x."""
    speeds = tuple(-sign * SPEED for sign in frame.rotors.reaction_sign)
    machine = five_bodies_machine(p.layout.bodies.drone, ZERO, speeds=speeds)
    return five_body_stabilisation.assembled_state(machine, BodyState(ZERO, ATTITUDE, ZERO, OMEGA), (0.0,) * 4, speeds)


def _solver_method(name: str, p: Any, state: Any, volts: tuple) -> SolverMethod:
    def prepare(steps: int, rows: int = SAMPLES + 1) -> Callable[[], Any]:
        motion = Motion(ZERO, NO_ROTATION, ZERO, ZERO, (0.0,) * 4)
        out = np.empty((rows, len(flatten(motion))))
        each = max(1, steps // SAMPLES)
        return lambda: (flight(METHOD.Method(), p, state, volts, DURATION / steps, each, out), out)

    def read(step: float, result: Any) -> SolverRun | None:
        defect, out = result
        if not np.isfinite(out).all():
            return None
        times = np.linspace(0.0, DURATION, SAMPLES + 1)
        motion = Motion(ZERO, NO_ROTATION, ZERO, ZERO, (0.0,) * 4)
        return SolverRun(times, coordinates(motion, out)[:, :18], defect, round(DURATION / step) * METHOD.EVALUATIONS)

    settings = [DURATION / (COARSEST * 2**k) for k in range(HALVINGS)]
    return SolverMethod(
        name, METHOD.ORDER, "s", settings, lambda h: prepare(round(DURATION / h)), read, prepare(1, rows=1)
    )


def inertia(frame: Any, angles: Any) -> np.ndarray:
    """Return the body inertia of frame and propellers at angles [rad], shape (3, 3); None: mean over a turn."""
    rotors, total = frame.rotors, np.diag(frame.mass.inertia).astype(float)
    along, across = rotors.blade_inertia
    for k, hub in enumerate(np.array(rotors.position)):
        half = 0.0 if angles is None else 0.5 * (along - across)
        c, s = (0.0, 0.0) if angles is None else (half * np.cos(2 * angles[k]), half * np.sin(2 * angles[k]))
        mean = 0.5 * (along + across)
        total += np.array([[mean + c, s, 0.0], [s, mean - c, 0.0], [0.0, 0.0, rotors.inertia]])
        total += rotors.mass * (hub @ hub * np.eye(3) - np.outer(hub, hub))
    return total


def reference(frame: Any) -> np.ndarray:
    """Return the final (position, R, velocity, omega), shape (18,).

    Without external torque the angular momentum keeps its world direction: R' = R hat(omega) with
    J(angles) omega + h = R^T L (theory, eq. (8.50)).
    """
    spin = -np.array(frame.rotors.reaction_sign) * SPEED
    own = np.array([0.0, 0.0, frame.rotors.inertia * spin.sum()])
    start = np.array(rotation_matrix(ATTITUDE)).reshape(3, 3)
    momentum = start @ (inertia(frame, 0.0 * spin) @ OMEGA + own)

    def omega(t: float, y: np.ndarray) -> np.ndarray:
        return np.linalg.solve(inertia(frame, spin * t), y.reshape(3, 3).T @ momentum - own)

    result = solve_ivp(
        lambda t, y: attitude_rate(y, omega(t, y)), (0.0, DURATION), start.ravel(), method="DOP853",
        rtol=TOLERANCE, atol=0.1 * TOLERANCE,
    )  # fmt: skip
    end = result.y[:, -1]
    # symmetric hubs: the centre of mass does not move
    return np.concatenate([ZERO, end, ZERO, omega(DURATION, end)])
