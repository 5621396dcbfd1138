"""Results of a campaign: its table in memory with derived statistics."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from lapwing.flights.metrics import METRICS
from lapwing.flights.outcome import FAILED
from lapwing.flights.tracking import AXES
from lapwing.services.common.schemas.success_criteria import KINDS
from lapwing.studies.campaign.fleet_columns import NEAREST
from lapwing.studies.campaign.folder import Folder
from lapwing.studies.campaign.runs import REJECTED
from lapwing.studies.campaign.statistics import Interval, Spread, interval, spread

# The worst value of all other metrics is the largest.
MIN_IS_WORST = (NEAREST, *(f"within_3sigma.{axis}" for axis in "xyz"), "within_95.nees")


class Results:
    """Runs of a campaign as columns, shape (n,) each.

    Attributes:
        folder: folder of the campaign.
        columns: columns of the completed runs by name.
        rejected: columns of the rejected runs by name.
        units: units of the varied keys, if known.
    """

    def __init__(self, folder: Folder, units: Mapping[str, str] | None = None):
        self.folder, self.units, columns = folder, units or {}, folder.arrays()
        is_flown = columns["outcome"] != REJECTED
        self.columns = {name: values[is_flown] for name, values in columns.items()}
        self.rejected = {name: values[~is_flown] for name, values in columns.items()}

    def __len__(self) -> int:
        """Return the number of completed runs."""
        return len(self.columns["run"])

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column of the completed runs."""
        return self.columns[name]

    @property
    def scene(self) -> str:
        """Name of the scene."""
        return str(self.folder.about["scene"])

    @property
    def vehicles(self) -> list[str]:
        """Vehicle names of a fleet, the prefixes of columns such as `left.rmse.x`; [] for a single vehicle."""
        return list(self.folder.about["vehicles"])

    @property
    def published(self) -> dict[str, float]:
        """Published values by the name of the metric, e.g. "rmse.x"."""
        return {f"rmse.{axis}": value for axis, value in self.folder.about["published"].get("rmse", {}).items()}

    @property
    def source(self) -> str:
        """Source of the published metrics."""
        return str(self.folder.about["published"].get("source", "published"))

    @cached_property
    def failure(self) -> Interval:
        """Probability of a failure."""
        return interval(int((~self["success"].astype(bool)).sum()), len(self))

    @property
    def lost(self) -> bool:
        """True if a vehicle crashed or diverged, whatever the criteria of success."""
        return bool(np.isin(self["outcome"].astype(str), FAILED).any())

    @cached_property
    def outcome_text(self) -> str:
        """Number of runs of each outcome: "97 landed, 3 crashed, 1 rejected"."""
        kinds = [(kind, int((self["outcome"] == kind).sum())) for kind in KINDS] + [
            (REJECTED, len(self.rejected["run"]))
        ]
        return ", ".join(f"{n} {kind}" for kind, n in kinds if n)

    @cached_property
    def figures(self) -> list[str]:
        """Numeric metrics that differ between runs."""
        numbers = [name for name in METRICS if self.folder.kinds[name] is float]
        return [name for name in numbers if len(np.unique(self[name][np.isfinite(self[name])])) > 1]

    @property
    def on_estimate(self) -> bool:
        """True if the autopilot flew on an estimate."""
        return any(not np.array_equal(self[f"rmse.{a}"], self[f"rmse_estimate.{a}"], equal_nan=True) for a in AXES)

    def spread(self, name: str) -> Spread | None:
        """Return the distribution of a metric."""
        return spread(self[name], self["run"], least=name in MIN_IS_WORST)

    def of_vehicles(self, name: str) -> dict[str, np.ndarray]:
        """Return a metric by vehicle name of a fleet; {} for a single vehicle."""
        return {vehicle: self[f"{vehicle}.{name}"] for vehicle in self.vehicles}

    def number(self, key: str) -> np.ndarray:
        """Return a parameter as numbers: texts by their alphabetical index."""
        values = self[key]
        return np.unique(values, return_inverse=True)[1].astype(float) if values.dtype == object else values

    def worst(self, count: int) -> list[dict[str, Any]]:
        """Return the worst runs: failures first, then the largest tracking errors."""
        distance = np.nan_to_num(self["max_distance"], nan=np.inf)
        order = np.lexsort((self["run"], -distance, self["success"].astype(bool)))[:count]
        return [{name: values[k] for name, values in self.columns.items()} for k in order]
