"""Identification of the plant about hover from a flight: gains and lag (theory, section 4.8).

The input is the controller's demand on the rotors, not the setpoint, so any controller and any excitation (chirp,
steps, square wave) can be used. Both sides pass the same low-pass filter, which yields angular accelerations from
gyroscope rates without amplification of noise.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import bilinear, lfilter

from lapwing.flights.flight_data import FlightData
from lapwing.services.autopilot.control import Parameters
from lapwing.studies.tune.linearise import Hover

FILTER_BANDWIDTH = 60.0  # [rad/s] above the loops' bandwidths
MIN_HEIGHT = 0.5  # [m] over the start, above the influence of the ground
LAGS = (2e-3, 0.5)  # [s] search interval of the rotors' lag
MIN_EXCITATION = 2e-3  # share of the hovering thrust, smallest deviation of an excited demand
MIN_FIT = 50.0  # [%]
LOOPS = ("altitude", "roll", "pitch", "yaw")


class Identification(NamedTuple):
    """Plant identified from a flight."""

    model: Hover
    fit: dict[str, float]  # [%] of each loop: 100 (1 - |y - model| / |y - mean|), filtered


class _Signals(NamedTuple):
    demand: np.ndarray  # (n, 4) [N] virtual controls per rotor, in the order of LOOPS
    response: np.ndarray  # (n, 4) filtered acceleration along z [m/s^2] and angular accelerations [rad/s^2]
    used: np.ndarray  # (n,) bool, in the air


def identify(flight: FlightData, p: Parameters, guess: Hover) -> Identification:
    """Fit acceleration = gain * lag(demand) + constant to a log.

    Args:
        flight: flight with actuators, setpoints and IMU, or ground truth without an IMU.
        p: parameters of a controller of the vehicle, for the rotors' shares.
        guess: linear model, for values that the log does not determine.

    Raises:
        ValueError: topics are missing, the vehicle is in the air for less than 2 s, or a loop is not excited or does
            not fit.
    """
    log = flight.origin.source
    missing = [name for name in ("actuators", "setpoint") if not flight.has(name)]
    if missing:
        raise ValueError(f"{log}: no topic {', '.join(missing)}; expected the log of a flight")
    tick = float(np.median(np.diff(flight.times("actuators"))))
    signals = _signals(flight, p, tick)
    if signals.used.sum() * tick < 2.0:
        raise ValueError(f"{log}: {signals.used.sum() * tick:.1f} s above {MIN_HEIGHT:g} m; expected 2 s or more")
    hovering = float(signals.demand[signals.used, 0].mean())
    for k, name in enumerate(LOOPS):
        deviation = float(signals.demand[signals.used, k].std())
        if deviation < MIN_EXCITATION * hovering:
            raise ValueError(f"{log}: {name} is not excited ({deviation:.2g} N); use a log of the scene excitation")
    result = minimize_scalar(
        lambda log_lag: sum(_fit(signals, k, float(np.exp(log_lag)), tick)[1] for k in range(4)),
        bounds=np.log(LAGS),
        method="bounded",
    )
    lag = float(np.exp(result.x))
    gains, fit = {}, {}
    for k, name in enumerate(LOOPS):
        (gains[name], *lead), residual = _fit(signals, k, lag, tick)
        if lead:
            gains["spin_up_zero"] = lead[0] / gains[name]
        fit[name] = float(100.0 * (1.0 - np.sqrt(residual)))
        if fit[name] < MIN_FIT:
            raise ValueError(
                f"{log}: {name} fits to {fit[name]:.0f} %, below {MIN_FIT:g} %; "
                "use a log of the scene excitation with less wind"
            )
    return Identification(guess._replace(lag=lag, **gains), fit)


def _signals(flight: FlightData, p: Parameters, tick: float) -> _Signals:
    """Return virtual controls and filtered responses tick by tick."""
    thrust = flight.actuators.thrust
    has_imu = flight.has("imu") and len(flight.topic("imu")) >= len(thrust)
    if has_imu:
        rates = flight.topic("imu").angular_velocity
        vertical = flight.topic("imu").linear_acceleration[:, 2]
    else:
        rates = flight.truth.angular_velocity
        vertical = flight.truth.acceleration[:, 2]
    height = flight.setpoint.position[:, 2]
    armed = flight.actuators.armed
    n = min(len(thrust), len(rates), len(height))
    delay = 1 if flight.metadata.get("coupling", "gauss_seidel") == "gauss_seidel" else 2
    demands = np.linalg.pinv(np.array(p.shares[0])).T  # from thrusts to virtual controls
    demand = np.vstack([np.zeros((delay, 4)), thrust[: n - delay] @ demands])
    low_pass, derivative = _filters(tick)
    response = np.column_stack([lfilter(*low_pass, vertical[:n]), lfilter(*derivative, rates[:n], axis=0)])
    flying = armed[:n] & (height[:n] > height[0] + MIN_HEIGHT)
    # the filters have settled after the take-off
    settled = np.convolve(~flying, np.ones(round(10.0 / FILTER_BANDWIDTH / tick)))[:n] == 0
    return _Signals(demand, response, settled)


def _filters(tick: float) -> tuple[tuple, tuple]:
    """Return the digital filters 1 / (s/w + 1)^2 and s / (s/w + 1)^2 with w = `FILTER_BANDWIDTH`."""
    denominator = [1.0 / FILTER_BANDWIDTH**2, 2.0 / FILTER_BANDWIDTH, 1.0]
    return bilinear([1.0], denominator, 1.0 / tick), bilinear([1.0, 0.0], denominator, 1.0 / tick)


def _fit(signals: _Signals, k: int, lag: float, tick: float) -> tuple[list[float], float]:
    """Return (gains of a loop for thrust, for yaw also its rate; unexplained share of the variance) at a lag [s]."""
    decay, used = np.exp(-tick / lag), signals.used
    thrust = lfilter([1.0 - decay], [1.0, -decay], signals.demand[:, k])
    regressors = [
        lfilter(*coefficients, thrust)[used] for coefficients in _filters(tick)[: 2 if LOOPS[k] == "yaw" else 1]
    ]
    response = signals.response[used, k]
    result, *_ = np.linalg.lstsq(np.column_stack([*regressors, np.ones(used.sum())]), response)
    residual = response - np.column_stack(regressors) @ result[:-1] - result[-1]
    return [float(g) for g in result[:-1]], float(residual.var() / response.var())
