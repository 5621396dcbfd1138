"""Case 15: motors that follow their voltage in ten microseconds, or at once."""

import numpy as np

from lapwing.services.scene_resolver import load
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.flights import fly

HARD = "rotors that follow their voltage within 10 us at a plant step of 1 ms: 36 times beyond RK4's stability"

STIFF, STEP, INTERVAL = 1e-5, 1e-3, 4e-3  # [s]
CONSTANT = 30.0 / (np.pi * 150.0 * (2.0 / 3.0))  # [V s/rad] of the drone's motors
ALLOWED = 1e-9
LAGS = np.geomspace(1e-2, 1e-6, 9)


def fly_with_lag(lag: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (times [s], maximum relative deviation of a rotor's speed from that of its voltage) of a flight."""
    truth = fly("hover", [f"airframe.motor.time_constant={lag!r}"]).truth
    speed, voltage = truth.rotor_speed, truth.motor_voltage
    return truth.times, np.abs(speed * CONSTANT - voltage).max(axis=1) / voltage.max()


def unsplit(lag: float, steps: int) -> np.ndarray:
    """Return the distance from 1 after each RK4 step at the plant's step on w' = (1 - w) / lag: the baseline."""
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
    t, off = fly_with_lag(STIFF)
    baseline = unsplit(STIFF, round(INTERVAL / STEP))
    with np.errstate(divide="ignore", invalid="ignore"):
        endless = np.float64(1.0) / np.float64(0.0) * np.float64(0.0)  # lag rate times a speed that is reached
    rows = [
        Row(
            "stiff",
            "steps are split until the lag is no faster than they are",
            "rotor speed against its voltage at every exchange, relative",
            ALLOWED,
            "400 time constants go by in an exchange: what is left is round-off and the order of the last step",
            float(off.max()),
            "RK4 at 1 ms, one exchange",
            float(baseline[-1]),
        ),
        Row(
            "zero",
            "a lag below 1 us is rejected with its key, value and limit",
            "scenes without lag that are flown",
            0.0,
            "none: a lag rate of infinity times a difference of nothing is no number",
            is_accepted(0.0) + is_accepted(1e-9),
            "1 / lag times the difference: NaN",
            float(np.isnan(endless)),
        ),
    ]
    curves = [Curve("split", t, np.maximum(off, 1e-17)), Curve("RK4 at 1 ms", STEP * np.arange(1, 5), baseline)]
    return CaseResult(rows, Plot("time [s]", "rotor speed off its voltage's, relative", curves, ALLOWED))


def sweep() -> Sweep:
    """Decrease the lag of the motors: distance at the end of a flight."""
    ours = np.array([fly_with_lag(float(lag))[1][-1] for lag in LAGS])
    baseline = np.array([unsplit(float(lag), 1000)[-1] for lag in LAGS])
    curves = [Curve("split", LAGS, ours), Curve("RK4 at 1 ms", LAGS, baseline)]
    return Sweep("lag [s]", "rotor speed off its voltage's", 1.0, curves, falling=True)
