"""Case 15: motors with a time constant of 10 us, or zero."""

import numpy as np

from lapwing.services.scene_resolver import load
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.flights import fly

HARD = "motors with a time constant of 10 us at a plant step of 1 ms: 36 times beyond the stability limit of RK4"

STIFF, STEP, INTERVAL = 1e-5, 1e-3, 4e-3  # [s]
CONSTANT = 30.0 / (np.pi * 150.0 * (2.0 / 3.0))  # [V s/rad] of the drone's motors
BOUND = 1e-9
LAGS = np.geomspace(1e-2, 1e-6, 9)


def fly_with_lag(lag: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (times [s], largest relative deviation of a rotor speed from its stationary value) of a flight."""
    truth = fly("hover", [f"airframe.motor.time_constant={lag!r}"]).truth
    speed, voltage = truth.rotor_speed, truth.motor_voltage
    return truth.times, np.abs(speed * CONSTANT - voltage).max(axis=1) / voltage.max()


def unsplit_error(lag: float, steps: int) -> np.ndarray:
    """Return the distance from 1 after each RK4 step of 1 ms for w' = (1 - w) / lag (baseline)."""
    z = -STEP / lag
    factor = 1.0 + z + z * z / 2.0 + z**3 / 6.0 + z**4 / 24.0
    with np.errstate(over="ignore"):
        return np.abs(factor) ** np.arange(1, steps + 1, dtype=float)


def is_accepted(lag: float) -> float:
    """Return 1 if a scene with this lag is accepted, 0 if it is rejected."""
    try:
        load("hover", [f"airframe.motor.time_constant={lag!r}"])
    except ValueError:
        return 0.0
    return 1.0


def run() -> CaseResult:
    """Fly with stiff motors, and with motors without lag."""
    t, deviation = fly_with_lag(STIFF)
    baseline = unsplit_error(STIFF, round(INTERVAL / STEP))
    with np.errstate(divide="ignore", invalid="ignore"):
        undefined = np.float64(1.0) / np.float64(0.0) * np.float64(0.0)  # infinite rate times a difference of zero
    rows = [
        Row("stiff", "steps split down to the time constant",
            "deviation of the rotor speed from its stationary value at every tick, relative", BOUND,
            "a tick lasts 400 time constants: round-off and the error of the last step remain", float(deviation.max()),
            "RK4 at 1 ms, one tick", float(baseline[-1])),
        Row("zero", "rejection of a time constant below 1 us with key, value and limit", "accepted scenes without lag",
            0.0, "none: an infinite rate times a difference of zero is NaN", is_accepted(0.0) + is_accepted(1e-9),
            "difference over the time constant: NaN", float(np.isnan(undefined))),
    ]  # fmt: skip
    curves = [Curve("split", t, np.maximum(deviation, 1e-17)), Curve("RK4 at 1 ms", STEP * np.arange(1, 5), baseline)]
    return CaseResult(rows, Plot("time [s]", "deviation of the rotor speed, relative", curves, BOUND))


def sweep() -> Sweep:
    """Decrease the time constant of the motors: deviation at the end of a flight."""
    ours = np.array([fly_with_lag(float(lag))[1][-1] for lag in LAGS])
    baseline = np.array([unsplit_error(float(lag), 1000)[-1] for lag in LAGS])
    curves = [Curve("split", LAGS, ours), Curve("RK4 at 1 ms", LAGS, baseline)]
    return Sweep("time constant [s]", "deviation of the rotor speed, relative", 1.0, curves, falling=True)
