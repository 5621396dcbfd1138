"""Design of a gain set: bandwidths are reduced loop by loop until all margins are reached."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lapwing.services.autopilot.controller_parameters import Airframe, build, lift, moments
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.margins import FREQUENCIES, LOOP_WORDS, margins, open_loops, stable
from lapwing.studies.tune.bandwidths import Bandwidths
from lapwing.studies.tune.linearise import Hover

PHASE_MARGIN, GAIN_MARGIN = 45.0, 6.0  # [deg], [dB] required margins
CORNERS = (0.8 / 1.2, 1.2 / 0.8)  # thrust over mass or inertia, each with an error of 20 % in the worse direction
DELAY = 1  # [ticks] of the Jacobi coupling, the larger of both
BACK_OFF = 0.95
ATTEMPTS = 60


def assumed_airframe(airframe: Airframe, model: Hover) -> Airframe:
    """Return the airframe with mass, inertia and lag of the linear model."""
    effects = model.roll, model.pitch, model.yaw
    x, y, z = (moment / k for moment, k in zip(moments(airframe), effects, strict=True))
    return airframe._replace(
        spin_up_zero=model.spin_up_zero,
        mass=lift(airframe) / model.altitude,
        inertia_body=(x, y, z),
        motor=airframe.motor._replace(time_constant=model.lag),
    )


def gain_set(model: Hover, bandwidths: Bandwidths) -> GainSet:
    """Return the gains of each loop from its bandwidth w: D = w / effect; P / D and I / P are proportional to w."""

    def loop(effect: float, w: float, p: float, i: float) -> tuple[float, float, float]:
        d = w / effect
        return _round(p * w * d), _round(i * w * p * w * d), _round(d)

    roll = loop(model.roll, bandwidths.attitude, 0.12, 0.024)
    outer = loop(model.tilt, bandwidths.position, 0.39, 0.032)
    text = ", ".join(f"{name} {value:.3g}" for name, value in bandwidths._asdict().items())
    return GainSet(
        description=f"lapwing tune: bandwidths {text} rad/s",
        altitude=loop(model.altitude, bandwidths.altitude, 0.39, 0.06),
        yaw=loop(model.yaw, bandwidths.yaw, 0.21, 0.017),
        roll_inner=(-roll[0], -roll[1], -roll[2]),
        pitch_inner=loop(model.pitch, bandwidths.attitude, 0.12, 0.024),
        roll_outer=outer,
        pitch_outer=outer,
        tilt_limit=0.6,
        reference_bandwidth=_round(4.1 * bandwidths.position),
        reference_damping=0.55,
        feed_forward=True,
    )


class Shortfall(NamedTuple):
    """Reason why a loop has not the required margins."""

    reason: str  # the same for all loops with this fault
    value: str = ""  # with its unit

    def __str__(self) -> str:
        """Return the reason, with the value if there is one."""
        return f"{self.reason} ({self.value})" if self.value else self.reason


UNSTABLE = Shortfall("unstable")


def shortfalls(loops: dict[str, np.ndarray]) -> dict[str, Shortfall]:
    """Return the fault of each loop that is unstable, has too small a margin, or is unstable at a corner."""
    result = {}
    for name, response in loops.items():
        m = margins(response)
        # Only the single loops and the cuts at the motors scale with the vehicle's gain.
        scaled = CORNERS if name in ("altitude", "yaw", "x_plant_input", "y_plant_input") else ()
        if not stable(response):
            result[name] = UNSTABLE
        elif not 0.0 < m.crossover < math.inf:
            result[name] = Shortfall(f"gain {'above' if m.crossover else 'below'} 1 up to {FREQUENCIES[-1]:g} rad/s")
        elif math.degrees(m.phase) < PHASE_MARGIN:
            result[name] = Shortfall(f"phase margin below {PHASE_MARGIN:g} deg", f"{math.degrees(m.phase):.1f} deg")
        elif min(_decibel(m.gain), -_decibel(m.reduction)) < GAIN_MARGIN:
            value = f"{_decibel(m.gain):.1f}/{_decibel(m.reduction):.1f} dB"
            result[name] = Shortfall(f"gain margin below {GAIN_MARGIN:g} dB", value)
        elif not all(stable(k * response) for k in scaled):
            result[name] = Shortfall("unstable with errors of 20 % in mass, inertia or thrust")
    return result


def design(
    model: Hover, airframe: Airframe, tick: float, initial: Bandwidths, warn: Callable[[str], None]
) -> Bandwidths:
    """Return the fastest bandwidths at or below `initial` whose gain set has the required margins.

    Args:
        model: plant about hover.
        airframe: nominal vehicle parameters of the controller.
        tick: period of the controller [s].
        initial: initial bandwidths.
        warn: called with a message for each reduced bandwidth.

    Raises:
        ValueError: no bandwidth down to a twentieth of `initial` has the margins.
    """
    plant, current = assumed_airframe(airframe, model), initial
    first_faults: dict[str, str] = {}
    for _ in range(ATTEMPTS):
        faults = shortfalls(open_loops(build(gain_set(model, current).plain(), airframe), plant, tick, DELAY))
        if not faults:
            for loop, previous in initial._asdict().items():
                if (value := getattr(current, loop)) < previous:
                    warn(f"{loop}: reduced from {previous:.3g} to {value:.3g} rad/s ({first_faults[loop]})")
            return current
        slower = {}
        for name, why in faults.items():
            loop = _owner(name, faults)
            first_faults.setdefault(loop, f"{LOOP_WORDS[name]}: {why}")
            slower[loop] = BACK_OFF * getattr(current, loop)
        current = current._replace(**slower)
    name, why = next(iter(faults.items()))
    fault = f"{LOOP_WORDS[name]}: {why}"
    raise ValueError(f"no gains with {PHASE_MARGIN:g} deg and {GAIN_MARGIN:g} dB found: {fault}; use lower bandwidths")


def _owner(name: str, faults: dict[str, Shortfall]) -> str:
    """Return the bandwidth responsible for a loop: the inner one of a cascade first."""
    if name in ("altitude", "yaw"):
        return name
    return "attitude" if {"roll", "pitch"} & faults.keys() else "position"


def _decibel(factor: float) -> float:
    return 20.0 * math.log10(factor) if factor > 0.0 else -math.inf


def _round(value: float) -> float:
    return float(f"{value:.4g}")
