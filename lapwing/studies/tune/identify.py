"""The plant about hover from a recorded flight: gains and lag that explain what was flown (theory.md, section 4.8).

The input is what the controller asked of the rotors, not the setpoint: so it does not matter which controller flew, nor
whether the excitation was a chirp, steps or a square wave. Both sides go through the same low-pass filter, which turns
the rates of the gyroscopes into angular accelerations without differentiating noise.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import bilinear, lfilter

from lapwing.services.autopilot.control import Parameters
from lapwing.studies.flight_data import FlightData
from lapwing.studies.tune.linearise import Hover

CUT = 60.0  # [rad/s] of the filter, above the loops' bandwidths
CLEAR = 0.5  # [m] over the start below which the ground may have a say
LAGS = (2e-3, 0.5)  # [s] between which the rotors' lag is sought
QUIET = 2e-3  # share of the hovering thrust below which a demand counts as not moved
LEAST_FIT = 50.0  # [%]
LOOPS = ("altitude", "roll", "pitch", "yaw")


class Identification(NamedTuple):
    """Plant identified from a flight."""

    model: Hover
    fit: dict[str, float]  # [%] of each loop: 100 (1 - |y - model| / |y - mean|), filtered


class _Signals(NamedTuple):
    demand: np.ndarray  # (n, 4) [N] asked of every rotor, as LOOPS
    response: np.ndarray  # (n, 4) filtered acceleration along z [m/s^2] and angular accelerations [rad/s^2]
    used: np.ndarray  # (n,) bool: in the air


def identify(flight: FlightData, p: Parameters, guess: Hover) -> Identification:
    """Fit acceleration = gain * lag(demand) + constant to a log.

    Args:
        flight: the flight; actuators, setpoints and the IMU (or the truth, where none was carried) are taken from it.
        p: a controller of the vehicle, for the rotors' shares and the hovering thrust.
        guess: linear model, for values that the log does not determine.

    Raises:
        ValueError: the log has no such topics, too little of it is in the air, or a loop was not moved or does not fit.
    """
    log = flight.origin.source
    lacking = [name for name in ("actuators", "setpoint") if not flight.has(name)]
    if lacking:
        raise ValueError(f"{log}: no topic {', '.join(lacking)}; expected the log of a flight")
    tick = float(np.median(np.diff(flight.times("actuators"))))
    signals = _signals(flight, p, tick)
    if signals.used.sum() * tick < 2.0:
        raise ValueError(f"{log}: {signals.used.sum() * tick:.1f} s above {CLEAR:g} m; expected 2 s or more")
    hovering = float(signals.demand[signals.used, 0].mean())
    for k, name in enumerate(LOOPS):
        moved = float(signals.demand[signals.used, k].std())
        if moved < QUIET * hovering:
            raise ValueError(f"{log}: {name} was not moved ({moved:.2g} N); fly the scene excitation and use its log")
    result = minimize_scalar(
        lambda log_lag: sum(_fit(signals, k, float(np.exp(log_lag)), tick)[1] for k in range(4)),
        bounds=np.log(LAGS),
        method="bounded",
    )
    lag = float(np.exp(result.x))
    gains, fit = {}, {}
    for k, name in enumerate(LOOPS):
        (gains[name], *lead), left = _fit(signals, k, lag, tick)
        if lead:
            gains["spin_up_zero"] = lead[0] / gains[name]
        fit[name] = float(100.0 * (1.0 - np.sqrt(left)))
        if fit[name] < LEAST_FIT:
            raise ValueError(
                f"{log}: {name} fits to {fit[name]:.0f} % only, {LEAST_FIT:g} % are needed; "
                "fly the scene excitation in less wind and use its log"
            )
    return Identification(guess._replace(lag=lag, **gains), fit)


def _signals(flight: FlightData, p: Parameters, tick: float) -> _Signals:
    """Return virtual controls and filtered responses tick by tick."""
    thrust = flight.actuators.thrust
    sensed = flight.has("imu") and len(flight.topic("imu")) >= len(thrust)
    if sensed:
        rates = flight.topic("imu").angular_velocity
        vertical = flight.topic("imu").linear_acceleration[:, 2]
    else:
        rates = flight.truth.angular_velocity
        vertical = flight.truth.acceleration[:, 2]
    height = flight.setpoint.position[:, 2]
    armed = flight.actuators.armed
    n = min(len(thrust), len(rates), len(height))
    delay = 1 if flight.metadata.get("coupling", "gauss_seidel") == "gauss_seidel" else 2
    demands = np.linalg.pinv(np.array(p.shares[0])).T  # what thrusts come to
    demand = np.vstack([np.zeros((delay, 4)), thrust[: n - delay] @ demands])
    smooth, differ = _filters(tick)
    response = np.column_stack([lfilter(*smooth, vertical[:n]), lfilter(*differ, rates[:n], axis=0)])
    flying = armed[:n] & (height[:n] > height[0] + CLEAR)
    settled = np.convolve(~flying, np.ones(round(10.0 / CUT / tick)))[:n] == 0  # the filters have forgotten the ground
    return _Signals(demand, response, settled)


def _filters(tick: float) -> tuple[tuple, tuple]:
    """Return the digital 1 / (s/CUT + 1)^2 and s / (s/CUT + 1)^2."""
    below = [1.0 / CUT**2, 2.0 / CUT, 1.0]
    return bilinear([1.0], below, 1.0 / tick), bilinear([1.0, 0.0], below, 1.0 / tick)


def _fit(signals: _Signals, k: int, lag: float, tick: float) -> tuple[list[float], float]:
    """Return a loop's gains of thrust, for yaw also of its rate, for a lag [s], and the unexplained variance share."""
    keep, used = np.exp(-tick / lag), signals.used
    thrust = lfilter([1.0 - keep], [1.0, -keep], signals.demand[:, k])
    regressors = [lfilter(*way, thrust)[used] for way in _filters(tick)[: 2 if LOOPS[k] == "yaw" else 1]]
    response = signals.response[used, k]
    result, *_ = np.linalg.lstsq(np.column_stack([*regressors, np.ones(used.sum())]), response)
    left = response - np.column_stack(regressors) @ result[:-1] - result[-1]
    return [float(g) for g in result[:-1]], float(left.var() / response.var())
