"""Case 20: the estimator with late or slow sensors, invalid sensor rates, and a process whose clock jumps."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.services.scene_resolver import load
from lapwing.studies.stability import flights, jumping_clock
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.cases.estimator import INVARIANT, SIGMAS, Outcome, fly

HARD = "GPS with a latency of 0.5 s, an IMU at 50 Hz, both; rates that do not divide the tick rate; jumping clocks"

LATE_GPS, SLOW_IMU = "sensors.gps.latency_samples=5", "sensors.imu.rate=50"  # [samples], 0.5 s; [Hz]
CASES = (("gps_late", [LATE_GPS]), ("imu_slow", [SLOW_IMU]), ("both", [LATE_GPS, SLOW_IMU]))
INDIVISIBLE_RATES = (
    "sensors.gps.rate=7",
    "sensors.imu.rate=99",
    "sensors.barometer.rate=60",
    "rates.pose=33",
    "rates.status=7",
)
SHORT, TIMEOUT = "run.duration=4.0", 600.0  # TIMEOUT in [s], for a process that hangs
WHY = "as in the case `estimator`"


def is_rejected(override: str) -> bool:
    """Return True if a scene with the override is rejected."""
    try:
        load("delivery_mission", [override])
    except ValueError:
        return True
    return False


def modulo_errors(period: int, ticks: int) -> int:
    """Return the number of missed or repeated messages of a schedule by floating-point modulo (baseline)."""
    interval = 0.004
    time = np.add.accumulate(np.full(ticks, interval)) - interval
    sent = np.mod(time, period * interval) < interval
    exact = np.arange(ticks) % period == 0
    return int((sent != exact).sum())


def differing_commands() -> int:
    """Return the number of commands that differ from a single-process flight if the autopilot's clocks jump."""
    steady = flights.fly("hover", [SHORT], None)  # first, because it compiles the kernels of the processes
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(jumping_clock.__file__, Path(folder) / "sitecustomize.py")
        log, paths = Path(folder) / "flight.mcap", [folder, *filter(None, sys.path)]
        arguments = ["run", "hover", "--set", SHORT, "--log", str(log)]
        process = subprocess.run(
            [sys.executable, "-m", "lapwing", *arguments],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            check=False,
        )
        if not log.exists():
            raise RuntimeError(f"a run with a jumping clock: {process.stderr.strip()}")
        jumped = FlightData.read(log)
        ours, theirs = jumped.actuators.motor_voltage, steady.actuators.motor_voltage
        n = min(len(ours), len(theirs))
        different = int((ours[:n] != theirs[:n]).any(axis=1).sum()) + abs(len(ours) - len(theirs))
        return max(different, int(jumped.digest != steady.digest))


def wall_clock_errors(ticks: int, interval: float) -> int:
    """Return the number of intervals that differ from a tick if measured with the wall clock (baseline)."""
    read = [t + jumping_clock.wall(t) for t in interval * np.arange(ticks + 1)]
    return int((np.abs(np.diff(read) - interval) > 1e-3 * interval).sum())


def worst(outcome: Outcome) -> float:
    """Return the largest error over its standard deviation while the estimate reports good health."""
    return float(outcome.ratio[outcome.healthy].max(initial=0.0))


def run() -> CaseResult:
    """Compare errors with the estimated covariance, and count rejected readings."""
    ours, baseline = "correction at the time of the fix", "correction at the time of arrival, entire flight"
    outcomes = {name: fly({}, extra) for name, extra in CASES}
    rows = [
        Row(name, ours, INVARIANT, SIGMAS, WHY, worst(outcomes[name]), baseline,
            float(fly({}, extra, ignore_age=True).ratio.max()))
        for name, extra in CASES
    ]  # fmt: skip
    rows.append(
        Row("odd_rates", "rejection with the key and the possible rates",
            f"accepted rates that do not divide the tick rate, of {len(INDIVISIBLE_RATES)}", 0.0,
            "none: messages are due at integer ticks",
            float(sum(not is_rejected(override) for override in INDIVISIBLE_RATES)),
            "schedule by floating-point modulo, one hour", float(modulo_errors(25, 900_000)))
    )  # fmt: skip
    rows.append(
        Row("jumping_clock", "lock step: time from the tick count",
            "commands that differ from a single-process flight; the autopilot's clocks jump 2 to 20 times per second",
            0.0, "none: the flight does not depend on process clocks", float(differing_commands()),
            "intervals from the wall clock", float(wall_clock_errors(1000, 0.004)))
    )  # fmt: skip
    curves = [Curve(name, o.t, np.maximum(o.ratio, 1e-3)) for name, o in outcomes.items()]
    return CaseResult(rows, Plot("time [s]", "error over its standard deviation", curves, SIGMAS))


def sweep() -> Sweep:
    """Increase the latency of fixes, with the IMU at 50 Hz."""
    late = np.arange(1, 8)
    extra = [[SLOW_IMU, f"sensors.gps.latency_samples={n}"] for n in late.tolist()]
    ours = np.array([worst(fly({}, m)) for m in extra])
    baseline = np.array([fly({}, m, ignore_age=True).ratio.max() for m in extra])
    curves = [
        Curve("correction at the time of the fix", 0.1 * late, ours),
        Curve("correction at the time of arrival, entire flight", 0.1 * late, baseline),
    ]
    return Sweep("latency of the fixes [s]", INVARIANT, SIGMAS, curves, log_x=False)
