"""Paired comparison of two campaigns over the same seeds, and the first difference of one pair of flights."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.flights.metrics import METRICS
from lapwing.messages.topics import ACTUATORS, BARO, ESTIMATE, GPS, IMU, MAG, SETPOINT, STATUS, TRUTH
from lapwing.studies.campaign.folder import Folder, read
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.runs import config_of, versions
from lapwing.studies.campaign.single_run import plan_of
from lapwing.studies.campaign.statistics import Interval, interval, paired_difference, ratio_change
from lapwing.studies.simulate import fly_each

SIGNALS = (TRUTH, IMU, GPS, BARO, MAG, ESTIMATE, SETPOINT, ACTUATORS, STATUS)  # in the order of the control loop
PLAN_ENTRIES = ("scene", "overrides", "vary", "sweep", "design", "versions")  # of a manifest; they define the flights


class Difference(NamedTuple):
    """Means of a metric in both campaigns, and their difference."""

    figure: str
    one: float  # mean
    other: float
    difference: Interval  # second minus first, over pairs of runs

    @property
    def is_significant(self) -> bool:
        """True if the interval excludes 0."""
        return self.difference.low > 0.0 or self.difference.high < 0.0


class FirstDifference(NamedTuple):
    """First different message of two flights, and their largest distance."""

    signal: str  # topic and field: "actuators: rate_setpoint.x"
    time: float  # [s]
    apart: float  # [m] largest distance of the true positions
    apart_time: float  # [s]


class Comparison(NamedTuple):
    """Result of a paired comparison of two campaigns."""

    names: tuple[str, str]
    differing: list[str]  # different entries of the plans, and keys with different drawn values
    pairs: int
    unpaired: int  # runs that only one campaign has or accepts
    failures: tuple[Interval, Interval]
    only_first: int  # pairs in which only the run of the first fails
    only_second: int  # pairs in which only the run of the second fails
    differences: list[Difference]  # "success" first
    tracking: Interval  # relative change of the distance from the path, root mean square; NaN without a reference
    run: int  # pair with the largest change of that distance
    first: FirstDifference | None = None  # of that pair
    not_flown: str = ""  # reason why it is unknown


def compare(one: Path, other: Path) -> Comparison:
    """Compare two campaigns over their common runs.

    Raises:
        ValueError: a folder is not a campaign, or the campaigns have no common runs.
    """
    a, b = Results(read(one)), Results(read(other))
    positions = {pair: k for k, pair in enumerate(_pairs(a))}
    pairs = [(positions[pair], k) for k, pair in enumerate(_pairs(b)) if pair in positions]
    if not pairs:
        raise ValueError(f"{one} and {other}: no run has the same seed; expected two campaigns with equal --seed")
    rows_a, rows_b = np.array(pairs).T
    success_a, success_b = a["success"][rows_a].astype(float), b["success"][rows_b].astype(float)
    differences = [
        Difference("success", float(success_a.mean()), float(success_b.mean()), paired_difference(success_a, success_b))
    ]
    for name in METRICS:
        if a.folder.kinds[name] is float:
            x, y = a[name][rows_a], b[name][rows_b]
            is_finite = np.isfinite(x) & np.isfinite(y)
            if is_finite.any():
                means = float(x[is_finite].mean()), float(y[is_finite].mean())
                differences.append(Difference(name, *means, paired_difference(x[is_finite], y[is_finite])))
    count = len(pairs)
    failures = interval(int(count - success_a.sum()), count), interval(int(count - success_b.sum()), count)
    only_first, only_second = int((success_a < success_b).sum()), int((success_b < success_a).sum())
    total = len(set(_pairs(a)) | set(_pairs(b)))
    keys = [key for key in a.folder.plan.keys if key in b.folder.plan.keys]
    different_values = [
        f"{key} (different values)" for key in keys if not np.array_equal(a[key][rows_a], b[key][rows_b])
    ]
    differing = _differing_entries(a.folder.about, b.folder.about) + different_values
    path_a, path_b = _path_error(a)[rows_a], _path_error(b)[rows_b]
    most = int(np.argmax(np.nan_to_num(np.abs(path_b - path_a), nan=-1.0)))
    result = Comparison(
        (str(one), str(other)), differing, count, total - count, failures, only_first, only_second, differences,
        ratio_change(path_a, path_b), int(a["run"][rows_a][most]),
    )  # fmt: skip
    try:
        return result._replace(first=first_difference(a.folder, b.folder, result.run))
    except ValueError as error:
        return result._replace(not_flown=str(error))


def _differing_entries(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Return the entries in which two plans differ; of overrides, those that only one has."""
    result = [name for name in PLAN_ENTRIES if one[name] != other[name]]
    own = [f"{text} (first only)" for text in one["overrides"] if text not in other["overrides"]]
    own += [f"{text} (second only)" for text in other["overrides"] if text not in one["overrides"]]
    if own:
        at = result.index("overrides")
        result[at : at + 1] = own
    return result


def _path_error(results: Results) -> np.ndarray:
    """Return the root-mean-square distance [m] from the reference of each run, shape (n,)."""
    return np.sqrt(sum(results[f"rmse.{axis}"].astype(float) ** 2 for axis in "xyz"))


def first_difference(one: Folder, other: Folder, run: int) -> FirstDifference | None:
    """Fly a run of both campaigns. Return the first different message; None if all are equal.

    Raises:
        ValueError: a campaign is of another version, or its scene has changed.
    """
    flights = []
    for folder in (one, other):
        if folder.about["versions"] != versions():
            raise ValueError(f"{folder.path} was flown with another version")
        plan = plan_of(Path(folder.plan.path), run, folder.path)
        flights.append(fly_each(config_of(plan, run), SIGNALS))
    found = [first for a, b in zip(*flights, strict=True) if (first := _first(a, b))]
    return min(found, key=lambda difference: difference.time, default=None)


def _first(a: FlightData, b: FlightData) -> FirstDifference | None:
    """Return the first difference of two flights of a vehicle, at equal times the first along the control loop."""
    first: tuple[float, str] | None = None
    for topic in SIGNALS:
        name = topic.key().removeprefix("//")
        if not (a.has(name) and b.has(name)):
            continue
        x, y = a.topic(name), b.topic(name)
        n, other = min(len(x), len(y)), y.flat()
        for field, column in x.flat().items():
            row = _first_row(column[:n], other[field][:n]) if field in other else None
            if row is not None and (first is None or x.times[row] < first[0]):
                first = float(x.times[row]), f"{name}: {field}"
    if first is None:
        return None
    n = min(len(a.truth), len(b.truth))
    distance = np.linalg.norm(a.truth.position[:n] - b.truth.position[:n], axis=-1)
    return FirstDifference(first[1], first[0], float(distance.max()), float(a.truth.times[distance.argmax()]))


def _first_row(a: np.ndarray, b: np.ndarray) -> int | None:
    both_nan = (a != a) & (b != b)
    different = np.flatnonzero((a != b) & ~both_nan)
    return int(different[0]) if len(different) else None


def _pairs(results: Results) -> list[tuple[int, int]]:
    return list(zip(results["run"].tolist(), results["seed"].tolist(), strict=True))
