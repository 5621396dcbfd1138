"""Case 20: the estimator on readings that are late, rare, or do not fit the clock; a process whose clock jumps."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from lapwing.services.scene_resolver import load
from lapwing.studies.flight_data import FlightData
from lapwing.studies.stability import flights, jumping_clock
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.cases.estimator import SIGMAS, Outcome, fly

HARD = (
    "GPS half a second late, an IMU at 50 Hz, both; rates that do not divide the clock's; a process whose clock jumps"
)

LATE, RARE = "sensors.gps.latency_samples=5", "sensors.imu.rate=50"  # half a second; [Hz]
CASES = (("gps_late", [LATE]), ("imu_slow", [RARE]), ("both", [LATE, RARE]))
ODD = ("sensors.gps.rate=7", "sensors.imu.rate=99", "sensors.barometer.rate=60", "rates.pose=33", "rates.status=7")
SHORT, TIMEOUT = "run.duration=4.0", 600.0  # [s] of the second: of a process that hangs
WHY = "as in the case `estimator`"


def is_stable(override: str) -> bool:
    """Return True if a scene with it is stable."""
    try:
        load("delivery_mission", [override])
    except ValueError:
        return True
    return False


def by_remainder(period: int, ticks: int) -> int:
    """Return the missed or repeated messages of a float-time modulo schedule: the baseline."""
    interval = 0.004
    time = np.add.accumulate(np.full(ticks, interval)) - interval
    sent = np.mod(time, period * interval) < interval
    exact = np.arange(ticks) % period == 0
    return int((sent != exact).sum())


def with_jumping_clock() -> int:
    """Return the number of commands that differ from a single-process flight if the autopilot's clocks jump."""
    steady = flights.fly("hover", [SHORT], None)  # first: it compiles what the processes then find
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(jumping_clock.__file__, Path(folder) / "sitecustomize.py")
        log, paths = Path(folder) / "flight.mcap", [folder, *filter(None, sys.path)]
        words = ["run", "hover", "--set", SHORT, "--log", str(log)]
        done = subprocess.run(
            [sys.executable, "-m", "lapwing", *words],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            check=False,
        )
        if not log.exists():
            raise RuntimeError(f"a run with a jumping clock: {done.stderr.strip()}")
        jumped = FlightData.read(log)
        ours, theirs = jumped.actuators.motor_voltage, steady.actuators.motor_voltage
        n = min(len(ours), len(theirs))
        unlike = int((ours[:n] != theirs[:n]).any(axis=1).sum()) + abs(len(ours) - len(theirs))
        return max(unlike, int(jumped.digest != steady.digest))


def by_own_clock(ticks: int, interval: float) -> int:
    """Return the intervals other than a tick of a controller that uses its clock: the baseline."""
    read = [t + jumping_clock.wall(t) for t in interval * np.arange(ticks + 1)]
    return int((np.abs(np.diff(read) - interval) > 1e-3 * interval).sum())


def worst(outcome: Outcome) -> float:
    """Return the maximum error over its standard deviation while the estimate reports good health."""
    return float(outcome.ratio[outcome.well].max(initial=0.0))


def run() -> CaseResult:
    """Compare errors with the estimated covariance, and count rejected readings."""
    what = "largest error over the claimed deviation, while it says that it is well"
    ours, baseline = "corrected at the time of the fix", "a fix counts as measured when it arrives; the whole flight"
    outcomes = {name: fly({}, more) for name, more in CASES}
    rows = [
        Row(
            name,
            ours,
            what,
            SIGMAS,
            WHY,
            worst(outcomes[name]),
            baseline,
            float(fly({}, more, as_if_on_time=True).ratio.max()),
        )
        for name, more in CASES
    ]
    rows.append(
        Row(
            "odd_rates",
            "rejected with the key and the possible rates",
            f"of {len(ODD)} rates that divide nothing, flown",
            0.0,
            "none: a message is due at whole ticks",
            float(sum(not is_stable(odd) for odd in ODD)),
            "sent whenever float time modulo the period is small, an hour",
            float(by_remainder(25, 900_000)),
        )
    )
    rows.append(
        Row(
            "jumping_clock",
            "lock step: time is a count of ticks",
            "commands that differ from a flight in one process; the autopilot's clocks jump 2 to 20 times a second",
            0.0,
            "none: no clock of a process enters the flight",
            float(with_jumping_clock()),
            "intervals by the process's own clock",
            float(by_own_clock(1000, 0.004)),
        )
    )
    curves = [Curve(name, o.t, np.maximum(o.ratio, 1e-3)) for name, o in outcomes.items()]
    return CaseResult(rows, Plot("time [s]", "error over the claimed deviation", curves, SIGMAS))


def sweep() -> Sweep:
    """Increase the latency of fixes, with the IMU at 50 Hz."""
    late = np.arange(1, 8)
    more = [[RARE, f"sensors.gps.latency_samples={n}"] for n in late.tolist()]
    ours = np.array([worst(fly({}, m)) for m in more])
    baseline = np.array([fly({}, m, as_if_on_time=True).ratio.max() for m in more])
    curves = [
        Curve("corrected at the time of the fix", 0.1 * late, ours),
        Curve("as measured when it arrives; the whole flight", 0.1 * late, baseline),
    ]
    what = "largest error over the claimed deviation, while it says that it is well"
    return Sweep("fixes late by [s]", what, SIGMAS, curves, log_x=False)
