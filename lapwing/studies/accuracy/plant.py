"""Multirotor of a scene as a problem: its plant with all effects in the air, under prescribed voltages."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lapwing.cosim.scene import Scene
from lapwing.dynamics import integrators
from lapwing.dynamics.integrators import rkmk54
from lapwing.dynamics.lie.quaternion import NO_ROTATION, exp
from lapwing.dynamics.noise import Key, stream_key
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles import multirotor, multirotor_slung
from lapwing.dynamics.vehicles.multirotor import advance, observe
from lapwing.dynamics.vehicles.multirotor_equations import (
    MultirotorParameters,
    MultirotorState,
    motion_of,
    with_tolerance,
)
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.codegen import map_index
from lapwing.kernels.state_tree import flatten
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.common.schemas.vehicle_schema import Vehicle, gravity
from lapwing.services.plant import models
from lapwing.studies.accuracy.coordinates import coordinates, defect
from lapwing.studies.accuracy.extended_numbers import Number
from lapwing.studies.accuracy.integrate import SAMPLES
from lapwing.studies.accuracy.problem import Problem, SolverMethod, SolverRun
from lapwing.studies.accuracy.round_off import coordinates_in_extended_precision, extend, in_extended_precision

DURATION = 2.0  # [s] approximately
HEIGHT = 20.0  # [m] clear of the ground
FINEST = 64  # steps of the reference per communication step; other runs have at most half as many
EXTENDED = (multirotor, multirotor_slung)  # formulations with steps in extended precision
JUMP, JUMP_INTERVAL = 0.02, 0.4  # [s] duration at a motor's limit; interval of the manoeuvres
VARIATION = 0.1  # of the voltages of hover, up or down every `JUMP`, in `varying_voltages`
TICK = 1000  # first tick, after the start of random effects
TOLERANCE = 1e-12  # of substeps at the limits of motors and flow, so that the errors of the steps remain


Voltages = Callable[[MultirotorParameters, float], tuple[float, ...]]  # [V] of each motor at a time [s]


def gentle_voltages(p: MultirotorParameters, t: float) -> tuple[float, ...]:
    """Return voltages [V] of a gentle flight, which vary by 2 % about hover. See `jumping_voltages` for arguments."""
    volts = hover_speed(p) / p.layout.speed_per_volt
    return tuple(volts * (1.0 + 0.02 * math.sin(3.0 * t + 2.4 * i)) for i in range(len(p.layout.x_body)))


def jumping_voltages(p: MultirotorParameters, t: float) -> tuple[float, ...]:
    """Return voltages [V] that jump over the entire range, as those of an autopilot after a setpoint jump.

    Args:
        p: parameters of the multirotor.
        t: time [s] since the start.
    """
    layout = p.layout
    number, part = divmod(t, JUMP_INTERVAL)
    axis = (layout.y_body, layout.x_body, layout.reaction_sign)[int(number) % 3]
    volts = hover_speed(p) / layout.speed_per_volt
    if part >= 4.0 * JUMP:
        return (volts,) * len(axis)
    sign = 1.0 if part < JUMP or part >= 3.0 * JUMP else -1.0
    return tuple(layout.max_voltage if sign * arm > 0.0 else 0.0 for arm in axis)


def varying_voltages(p: MultirotorParameters, t: float) -> tuple[float, ...]:
    """Return voltages [V] that jump by a tenth, independently for each motor. See `jumping_voltages` for arguments.

    At a limit of a motor or the flow steps are under error control, so those of `jumping_voltages` do not show the
    error of steps between limits.
    """
    volts, number = hover_speed(p) / p.layout.speed_per_volt, round(t / JUMP - 0.5)
    signs = (math.copysign(VARIATION, math.sin(13.0 * (number + 1) * (i + 1))) for i in range(len(p.layout.x_body)))
    return tuple(volts * (1.0 + sign) for sign in signs)


MANOEUVRES = (gentle_voltages, jumping_voltages, varying_voltages)


@always_inline
def _entry(rows: np.ndarray, row: int, i: int) -> float:
    return rows[row, i]


@kernel
def flight(
    method: Any,
    p: MultirotorParameters,
    key: Key,
    state: MultirotorState,
    voltages: np.ndarray,
    h: float,
    n: int,
    every: int,
    out: np.ndarray,
) -> None:
    """Fly ticks of n steps of h [s] under the rows of `voltages`; store the motion in `out` every `every` ticks."""
    tick = 0
    for row in range(out.shape[0]):
        if row > 0:
            for _ in range(every):
                volts = map_index(_entry, p.layout.x_body, voltages, tick)
                state = advance(method, p, key, TICK + tick, state, volts, h, n)
                tick += 1
        numbers = flatten(motion_of(p.layout, state.motion))
        for i in range(len(numbers)):
            out[row, i] = numbers[i]


def physics(scene: Scene, level: bool = False) -> tuple[MultirotorParameters, MultirotorState]:
    """Return (parameters, initial state) of a scene with a multirotor of one or more bodies, airborne.

    Args:
        scene: scene of a multirotor.
        level: start level without rotation; otherwise tilted and rotating.
    """
    formulation, p = model(scene).describe(scene)
    p = with_tolerance(p, TOLERANCE)
    attitude, omega_body = (NO_ROTATION, ZERO) if level else (exp((0.1, -0.15, 0.3)), (0.4, -0.6, 0.3))
    state = formulation.initial_state(p, (0.0, 0.0, HEIGHT), attitude, hover_speed(p), (3.0, 1.0, -0.5), omega_body)
    if formulation is multirotor_slung:  # stretched by the load, so the cable stays taut and no step is split
        sling, (x, y, z) = p.layout.bodies, state.motion.load_position
        load = (x, y, z - sling.load_mass * gravity(scene) / sling.stiffness)
        state = state._replace(motion=state.motion._replace(load_position=load))
    return p, state


def model(scene: Scene) -> Any:
    """Return the module of the scene's plant model."""
    return models.get(scene[Vehicle].model)


def longest_step(scene: Scene) -> float:
    """Return the longest step [s] that the scene's model accepts."""
    result = getattr(model(scene), "longest_step", None)
    return result(scene) if result else math.inf


def problem(scene: Scene, manoeuvre: Voltages = gentle_voltages) -> Problem:
    """Return the multirotor of a scene under the voltages of a manoeuvre as a problem."""
    exchange = scene[Communication]
    gentle = manoeuvre is gentle_voltages
    (p, state), longest = physics(scene, not gentle), longest_step(scene)
    formulation = model(scene).describe(scene)[0]
    motion = multirotor.initial_state(p).motion  # equal shape for every formulation
    every = max(1, round(DURATION * exchange.rate / SAMPLES))
    duration = SAMPLES * every * exchange.interval
    start = TICK if gentle else 0
    voltages = np.array([manoeuvre(p, (start + i) * exchange.interval) for i in range(SAMPLES * every)])
    key = stream_key(scene[Run].seed, scene[Vehicle].name, "plant")

    def prepare_flight(method: Any, steps: int, rows: int = SAMPLES + 1) -> Callable[[], Any]:
        out = np.empty((rows, len(flatten(motion))))
        token, h = method.Method(), exchange.interval / steps
        return lambda: (flight(token, p, key, state, voltages, h, steps, every, out), out)[1]

    def solver_method(name: str) -> SolverMethod:
        method = integrators.get(name)

        def read(step: float, out: np.ndarray) -> SolverRun | None:
            if not np.isfinite(out).all():
                return None
            per_step = getattr(method, "EVALUATIONS", None)
            evaluations = per_step and SAMPLES * every * round(exchange.interval / step) * per_step
            times = np.linspace(0.0, duration, SAMPLES + 1)
            return SolverRun(times, coordinates(motion, out), defect(motion, out[-1]), evaluations)

        def final_state_in_extended_precision(step: float) -> np.ndarray:
            count = round(exchange.interval / step)
            fly, h = extend(advance), Number(exchange.interval / count)
            x, numbers = in_extended_precision(state), in_extended_precision(p)
            for tick, voltage in enumerate(map(tuple, voltages.tolist()), TICK):
                x = fly(method.Method(), numbers, key, tick, x, in_extended_precision(voltage), h, count)
            return coordinates_in_extended_precision(motion, extend(motion_of)(numbers.layout, x.motion))

        settings = [h for h in (exchange.interval / 2**k for k in range(6)) if h <= longest]
        return SolverMethod(
            name, method.ORDER, "s", settings, lambda h: prepare_flight(method, round(exchange.interval / h)), read,
            prepare_flight(method, 1, rows=1), final_state_in_extended_precision if formulation in EXTENDED else None,
        )  # fmt: skip

    return Problem(
        f"{scene.name}: its multirotor in the air under {'prescribed' if gentle else manoeuvre.__name__.split('_')[0]} "
        "voltages",
        duration,
        [solver_method(name) for name in integrators.compatible_methods(p, state.motion)],
        lambda: coordinates(motion, prepare_flight(rkmk54, FINEST)())[-1],
        f"rkmk54 with {FINEST} steps per communication step",
    )


def hover_speed(p: MultirotorParameters) -> float:
    """Return the rotor speed [rad/s] that balances the weight."""
    low, high = 0.0, p.layout.speed_per_volt * p.layout.max_voltage
    for _ in range(50):
        middle = 0.5 * (low + high)
        state = multirotor.initial_state(p, (0.0, 0.0, HEIGHT), rotor_speed=middle)
        volts = (middle / p.layout.speed_per_volt,) * len(p.layout.x_body)
        rises = observe(p, TICK, 1e-3, state, volts).acceleration_world[2] > 0.0
        low, high = (low, middle) if rises else (middle, high)
    return 0.5 * (low + high)
