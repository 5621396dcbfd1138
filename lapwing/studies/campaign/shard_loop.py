"""Execution of a campaign shard by shard, with counts of the outcomes."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from lapwing.services.common.schemas.success_criteria import KINDS
from lapwing.studies.campaign.folder import Folder
from lapwing.studies.campaign.runs import REJECTED, Reference, Row, fly_runs
from lapwing.studies.campaign.statistics import Interval, interval
from lapwing.studies.workers import Workers


class Count(NamedTuple):
    """Number of runs by outcome."""

    runs: int = 0
    successes: int = 0
    kinds: Mapping[str, int] = MappingProxyType({})  # number of runs by outcome

    @property
    def accepted(self) -> int:
        """Number of runs that the scene accepted."""
        return self.runs - self.kinds.get(REJECTED, 0)

    @property
    def failures(self) -> int:
        """Number of accepted runs without success."""
        return self.accepted - self.successes

    @property
    def failure(self) -> Interval:
        """Probability of a failure."""
        return interval(self.failures, self.accepted)

    def __add__(self, other: "Count") -> "Count":  # type: ignore[override]
        kinds = Counter(self.kinds) + Counter(other.kinds)
        return Count(self.runs + other.runs, self.successes + other.successes, kinds)

    def __str__(self) -> str:
        return ", ".join(f"{self.kinds[kind]} {kind}" for kind in (*KINDS, REJECTED) if kind in self.kinds)


def count(rows: Iterable[Row]) -> Count:
    """Return the counts of some rows."""
    table = list(rows)
    return Count(len(table), sum(row["success"] for row in table), Counter(row["outcome"] for row in table))


def campaign(
    folder: Folder,
    reference: Reference,
    workers: Workers,
    progress: Callable[[Count], None] = lambda count: None,
    half_width: float | None = None,
    shards: Iterable[int] | None = None,
) -> Count:
    """Fly the missing runs.

    Args:
        folder: folder of the campaign.
        reference: result that each worker must reproduce.
        workers: executor of the tasks.
        progress: called with the counts so far, including earlier runs.
        half_width: end at this half-width of the failure probability's confidence interval; None: fly all runs. The
            last run does not depend on the workers.
        shards: numbers of the shards to fly; None: all.

    Returns:
        Counts of all runs of the table.

    Raises:
        RunFailed: results cannot be written, or a worker is lost.
    """
    folder.end_after(None)
    missing_shards = set(folder.missing())
    missing = sorted(missing_shards if shards is None else missing_shards.intersection(shards))
    counts = {k: count(folder.rows(k)) for k in range(len(folder.shards)) if k not in missing_shards}
    total, rule = sum(counts.values(), Count()), StoppingRule(half_width)
    if not rule.reached(counts):
        progress(total)
        plan = folder.plan.with_absolute_path()
        tasks = [(plan, reference, folder.shards[k].start, folder.shards[k].stop) for k in missing]
        results = workers(fly_runs, tasks)
        for index, rows in results:
            folder.write(missing[index], rows)
            counts[missing[index]] = count(rows)
            total += counts[missing[index]]
            progress(total)
            if rule.reached(counts):
                break
        results.close()  # type: ignore[attr-defined]
    if rule.reached(counts):
        folder.end_after(rule.shard)
        return rule.total
    return total


class StoppingRule:
    """Stopping rule: the first shard at which the confidence interval is narrow enough.

    Attributes:
        shard: this shard, or the next one to check.
        total: counts of the runs up to this shard.
    """

    def __init__(self, half_width: float | None):
        """Create a rule for a half-width of the failure probability's confidence interval; None: never stop."""
        self.shard, self.total = 0, Count()
        self._half_width, self._reached = half_width, False

    def reached(self, counts: Mapping[int, Count]) -> bool:
        """Return True if the counts of these shards suffice."""
        while self._half_width is not None and not self._reached and self.shard in counts:
            self.total += counts[self.shard]
            self._reached = self.total.accepted > 0 and self.total.failure.half_width <= self._half_width
            self.shard += not self._reached
        return self._reached
