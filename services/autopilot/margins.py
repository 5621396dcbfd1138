"""Stability margins of the control loops about hover (theory, eqs. (4.30)-(4.34))."""

from typing import Any, NamedTuple

import numpy as np

from lapwing.services.autopilot.control import Parameters
from lapwing.services.autopilot.controller_parameters import Airframe, lift, moments
from lapwing.services.autopilot.pid import Pid

FREQUENCIES = np.geomspace(0.01, 700.0, 20_000)  # [rad/s] up to the Nyquist frequency at 250 Hz

LOOP_WORDS = {
    "altitude": "altitude loop",
    "yaw": "yaw loop",
    "roll": "roll loop",
    "y": "sideways position loop",
    "y_plant_input": "roll with sideways loop",
    "pitch": "pitch loop",
    "x": "forward position loop",
    "x_plant_input": "pitch with forward loop",
}


class Margins(NamedTuple):
    """Stability margins of a loop."""

    crossover: float  # highest frequency of unit gain [rad/s]; inf if the gain is always above 1, 0 if always below
    phase: float  # minimum phase margin over all crossings of unit gain [rad]; inf without one
    gain: float  # smallest destabilising gain factor above 1; inf without one
    reduction: float  # largest destabilising gain factor below 1; 0 without one


def open_loops(
    p: Parameters, airframe: Airframe, tick: float, delay: int = 1, gain: float = 1.0
) -> dict[str, np.ndarray]:
    """Return the open-loop responses of all loops at FREQUENCIES.

    altitude, yaw: single loops; roll, pitch: inner loops with open outer loops; y, x: outer loops with closed inner
    loops; y_plant_input, x_plant_input: both loops of an axis, opened at the plant input.

    Args:
        p: controller parameters.
        airframe: vehicle parameters.
        tick: controller period [s]; the zero-order hold adds half of it as delay.
        delay: [ticks] between a measurement and the effect of its command.
        gain: true over assumed acceleration per thrust.
    """
    s = 1j * FREQUENCIES
    return loops(p, airframe, s, gain * np.exp(-(delay + 0.5) * tick * s))


def loops(p: Parameters, airframe: Airframe, s: Any, transport: Any) -> dict[str, Any]:
    """Return the loops of `open_loops` at complex frequencies `s` [rad/s] with `transport` as delay and gain.

    Both may also be transfer functions, with s as the derivative.
    """
    lag = 1.0 / (1.0 + airframe.motor.time_constant * s)
    moment_x, moment_y, moment_z = moments(airframe)
    i_x, i_y, i_z = airframe.inertia_body
    responses = {
        "altitude": _pid(p.altitude, s) * lift(airframe) / airframe.mass * lag * transport / s**2,
        "yaw": _pid(p.yaw, s) * moment_z / i_z * (1.0 + airframe.spin_up_zero * s) * lag * transport / s**2,
    }
    smooth = p.smoothing.bandwidth**2 / (
        s**2 + 2.0 * p.smoothing.damping * p.smoothing.bandwidth * s + p.smoothing.bandwidth**2
    )
    for tilt, axis, feedback, outer, effect in (
        ("roll", "y", -_pid(p.roll_inner, s), p.roll_outer, moment_x / i_x),
        ("pitch", "x", _pid(p.pitch_inner, s), p.pitch_outer, moment_y / i_y),
    ):
        turn = effect * lag * transport / s**2  # tilt over demand
        demand = feedback * smooth  # demand over desired tilt
        if p.smoothing.lag > 0.0:
            demand = smooth * (s**2 / effect + feedback / (1.0 + p.smoothing.lag * s))
        position = _pid(outer, s) * p.gravity / s**2  # desired tilt over tilt
        responses[tilt] = turn * feedback
        responses[axis] = position * turn * demand / (1.0 + turn * feedback)
        responses[f"{axis}_plant_input"] = turn * (feedback + position * demand)
    return responses


def margins(loop: np.ndarray) -> Margins:
    """Return the margins of an open loop sampled at FREQUENCIES; it may have any number of integrators."""
    size, angle = np.abs(loop), np.unwrap(np.angle(loop))
    unit = np.flatnonzero(np.diff(np.sign(size - 1.0)))
    turn = np.flatnonzero(np.diff(np.sign(np.cos(0.5 * angle))))  # crossings of odd multiples of 180 degrees
    at = size[turn]
    above, below = at[at < 1.0], at[at >= 1.0]
    return Margins(
        crossover=float(FREQUENCIES[unit[-1]]) if unit.size else np.inf if size[-1] > 1.0 else 0.0,
        phase=float(np.min(np.abs(np.angle(-loop[unit])), initial=np.inf)),
        gain=float(1.0 / above.max()) if above.size else np.inf,
        reduction=float(1.0 / below.min()) if below.size else 0.0,
    )


def stable(loop: np.ndarray) -> bool:
    """Return True if the closed loop is stable by the Nyquist criterion; open-loop poles must be at 0 or stable.

    With increasing frequency, 1 + L turns by a quarter per integrator, and by a full turn less per pair of unstable
    poles.
    """
    integrators = round(-np.log(np.abs(loop[1] / loop[0])) / np.log(FREQUENCIES[1] / FREQUENCIES[0]))
    angle = np.unwrap(np.angle(1.0 + loop))
    return bool(abs(angle[-1] - angle[0] - 0.5 * np.pi * integrators) < np.pi)


def excess(loop: np.ndarray) -> float:
    """Return the factor by which the gain is too high (below 1: too low), 1 for a stable loop, NaN if none helps."""
    if stable(loop):
        return 1.0
    for decibels in np.arange(0.5, 60.0, 0.5):
        for factor in (10.0 ** (decibels / 20.0), 10.0 ** (-decibels / 20.0)):
            if stable(loop / factor):
                return float(factor)
    return np.nan


def _pid(g: Pid, s: Any) -> Any:
    return g.p + g.i / s + g.d * s
