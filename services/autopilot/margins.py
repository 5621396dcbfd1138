"""Stability margins of the loops about hover, from their frequency responses (theory.md, eqs. (4.30)-(4.34))."""

from typing import Any, NamedTuple

import numpy as np

from lapwing.services.autopilot.control import Parameters
from lapwing.services.autopilot.controller_parameters import Airframe, lift, moments
from lapwing.services.autopilot.pid import Pid

FREQUENCIES = np.geomspace(0.01, 700.0, 20_000)  # [rad/s] up to Nyquist's at 250 Hz


class Margins(NamedTuple):
    """How far a loop is from instability."""

    crossover: (
        float  # the highest frequency of unit gain [rad/s]; inf or 0 where the gain is above or below 1 throughout
    )
    phase: float  # least phase margin over all crossings of unit gain [rad]; inf without one
    gain: float  # factor on the gain that makes the loop unstable, from above
    reduction: float  # factor below 1 on the gain that makes it unstable, 0 where none does


def open_loops(
    p: Parameters, airframe: Airframe, tick: float, delay: int = 1, gain: float = 1.0
) -> dict[str, np.ndarray]:
    """Open-loop responses at FREQUENCIES of every loop.

    altitude, yaw: their single loops; roll, pitch: the inner loops, the outer ones open; y, x: the outer loops, the
    inner ones closed; y_plant_input, x_plant_input: both loops of an axis, broken at the plant input.

    Args:
        p: the controller.
        airframe: what it controls.
        tick: the controller's period [s]; the command is held over it, which delays by half of it.
        delay: whole ticks between a measurement and its command's effect.
        gain: true over assumed acceleration per thrust, as a lighter or stronger vehicle has it.
    """
    s = 1j * FREQUENCIES
    return loops(p, airframe, s, gain * np.exp(-(delay + 0.5) * tick * s))


def loops(p: Parameters, airframe: Airframe, s: Any, late: Any) -> dict[str, Any]:
    """The loops of `open_loops` at the complex frequencies `s` [rad/s], where the loop's delay and gain come to `late`.

    Both may also be transfer functions, s that of a derivative.
    """
    lag = 1.0 / (1.0 + airframe.motor.time_constant * s)
    moment_x, moment_y, moment_z = moments(airframe)
    i_x, i_y, i_z = airframe.inertia_body
    found = {
        "altitude": _pid(p.altitude, s) * lift(airframe) / airframe.mass * lag * late / s**2,
        "yaw": _pid(p.yaw, s) * moment_z / i_z * (1.0 + airframe.spin_up_zero * s) * lag * late / s**2,
    }
    smooth = p.smoothing.bandwidth**2 / (
        s**2 + 2.0 * p.smoothing.damping * p.smoothing.bandwidth * s + p.smoothing.bandwidth**2
    )
    for tilt, way, feedback, outer, effect in (
        ("roll", "y", -_pid(p.roll_inner, s), p.roll_outer, moment_x / i_x),
        ("pitch", "x", _pid(p.pitch_inner, s), p.pitch_outer, moment_y / i_y),
    ):
        turn = effect * lag * late / s**2  # tilt over demand
        demand = feedback * smooth  # demand over tilt asked for
        if p.smoothing.lag > 0.0:
            demand = smooth * (s**2 / effect + feedback / (1.0 + p.smoothing.lag * s))
        position = _pid(outer, s) * p.gravity / s**2  # tilt asked for over tilt
        found[tilt] = turn * feedback
        found[way] = position * turn * demand / (1.0 + turn * feedback)
        found[f"{way}_plant_input"] = turn * (feedback + position * demand)
    return found


def margins(loop: np.ndarray) -> Margins:
    """The margins of an open loop sampled at FREQUENCIES; it may begin with any number of integrators."""
    size, angle = np.abs(loop), np.unwrap(np.angle(loop))
    unit = np.flatnonzero(np.diff(np.sign(size - 1.0)))
    turn = np.flatnonzero(np.diff(np.sign(np.cos(0.5 * angle))))  # crossings of -180 degrees and its like
    at = size[turn]
    above, below = at[at < 1.0], at[at >= 1.0]
    return Margins(
        crossover=float(FREQUENCIES[unit[-1]]) if unit.size else np.inf if size[-1] > 1.0 else 0.0,
        phase=float(np.min(np.abs(np.angle(-loop[unit])), initial=np.inf)),
        gain=float(1.0 / above.max()) if above.size else np.inf,
        reduction=float(1.0 / below.min()) if below.size else 0.0,
    )


def stable(loop: np.ndarray) -> bool:
    """Whether the closed loop is stable, by Nyquist's criterion; the open loop's poles lie at 0 or to the left.

    1 + L turns by a quarter for each integrator on the way up the frequencies, and by a full turn less for each
    pair of unstable poles.
    """
    integrators = round(-np.log(np.abs(loop[1] / loop[0])) / np.log(FREQUENCIES[1] / FREQUENCIES[0]))
    angle = np.unwrap(np.angle(1.0 + loop))
    return bool(abs(angle[-1] - angle[0] - 0.5 * np.pi * integrators) < np.pi)


def excess(loop: np.ndarray) -> float:
    """Factor by which the gain of an unstable loop is too high (below 1: too low); 1 for a stable one, NaN for none."""
    if stable(loop):
        return 1.0
    for decibels in np.arange(0.5, 60.0, 0.5):
        for factor in (10.0 ** (decibels / 20.0), 10.0 ** (-decibels / 20.0)):
            if stable(loop / factor):
                return float(factor)
    return np.nan


def _pid(g: Pid, s: Any) -> Any:
    return g.p + g.i / s + g.d * s
