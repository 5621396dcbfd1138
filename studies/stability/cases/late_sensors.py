"""Case 20: the estimator on readings that are late, rare, or do not fit the clock."""

import numpy as np

from services.table import load
from studies.stability.case import Curve, Found, Plot, Row
from studies.stability.cases.estimator import SIGMAS, Outcome, flown

HARD = "GPS half a second late, an IMU at 50 Hz, messages at rates that do not divide the clock's"

LATE = 5  # readings of 0.1 s
ODD = ("sensors.gps.rate=7", "sensors.imu.rate=99", "sensors.barometer.rate=60", "rates.pose=33", "rates.status=7")
WHY = "as in the case `estimator`"


def refused(override: str) -> bool:
    """Whether a scene with it is."""
    try:
        load("delivery_mission", [override])
    except ValueError:
        return True
    return False


def by_remainder(period: int, ticks: int) -> int:
    """The naive schedule, float time modulo the period below an interval: messages missed or sent twice."""
    interval = 0.004
    time = np.add.accumulate(np.full(ticks, interval)) - interval
    sent = np.mod(time, period * interval) < interval
    exact = np.arange(ticks) % period == 0
    return int((sent != exact).sum())


def worst(found: Outcome) -> float:
    """The largest error over what is claimed, while it says that it is well."""
    return float(found.ratio[found.well].max(initial=0.0))


def run() -> Found:
    """Errors against what is claimed, and what is refused."""
    late = [f"sensors.gps.latency_samples={LATE}"]
    rare = ["sensors.imu.rate=50"]
    what = "largest error over the claimed deviation, while it says that it is well"
    ours, naive = "corrected at the time of the fix", "a fix counts as measured when it arrives; the whole flight"
    flights = {name: flown({}, more) for name, more in (("gps_late", late), ("imu_slow", rare))}
    rows = [
        Row(
            name,
            ours,
            what,
            SIGMAS,
            WHY,
            worst(flights[name]),
            naive,
            float(flown({}, more, as_if_on_time=True).ratio.max()),
        )
        for name, more in (("gps_late", late), ("imu_slow", rare))
    ]
    rows.append(
        Row(
            "odd_rates",
            "refused with the key and the rates that would do",
            f"of {len(ODD)} rates that divide nothing, flown",
            0.0,
            "none: a message is due at whole ticks",
            float(sum(not refused(odd) for odd in ODD)),
            "sent whenever float time modulo the period is small, an hour",
            float(by_remainder(25, 900_000)),
        )
    )
    curves = [Curve(name, o.t, np.maximum(o.ratio, 1e-3)) for name, o in flights.items()]
    return Found(rows, Plot("time [s]", "error over the claimed deviation", curves, SIGMAS))
