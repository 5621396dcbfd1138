"""Flies a campaign, shard by shard, and counts."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from lapwing.studies.campaign.folder import Folder
from lapwing.studies.campaign.runs import REFUSED, Reference, Row, fly_runs
from lapwing.studies.campaign.statistics import Interval, interval
from lapwing.studies.outcome import KINDS

Workers = Callable[[Callable[..., Any], Iterable[tuple]], Iterator[tuple[int, Any]]]
"""(call, tasks) -> (place of a task, call(*task)), as soon as they are there."""


class Count(NamedTuple):
    """Number of runs by outcome."""

    runs: int = 0
    successes: int = 0
    kinds: tuple[tuple[str, int], ...] = ()  # how many ended how

    @property
    def accepted(self) -> int:
        """Runs that the scene took."""
        return self.runs - dict(self.kinds).get(REFUSED, 0)

    @property
    def failures(self) -> int:
        """Runs that were flown without success."""
        return self.accepted - self.successes

    @property
    def failure(self) -> Interval:
        """Probability of a failure."""
        return interval(self.failures, self.accepted)

    def __add__(self, other: "Count") -> "Count":  # type: ignore[override]
        kinds = {kind: dict(self.kinds).get(kind, 0) + dict(other.kinds).get(kind, 0) for kind in (*KINDS, REFUSED)}
        counts = tuple((kind, n) for kind, n in kinds.items() if n)
        return Count(self.runs + other.runs, self.successes + other.successes, counts)

    def __str__(self) -> str:
        return ", ".join(f"{n} {kind}" for kind, n in self.kinds)


def count(rows: Iterable[Row]) -> Count:
    """Return the counts of some rows."""
    table = list(rows)
    kinds = Counter(row["outcome"] for row in table)
    return Count() + Count(len(table), sum(row["success"] for row in table), tuple(kinds.items()))


def campaign(
    folder: Folder,
    reference: Reference,
    workers: Workers,
    progress: Callable[[Count], None] = lambda count: None,
    until: float | None = None,
    part: Iterable[int] | None = None,
) -> Count:
    """Fly what is missing.

    Args:
        folder: of the campaign.
        reference: what each worker has to agree on.
        workers: who flies.
        progress: is told what the runs so far came to, those of before among them.
        until: end as soon as the probability of a failure is known to this on either side; which run is the last does
            not depend on the workers.
        part: the shards to fly, None for all.

    Returns:
        What all runs of the table came to.

    Raises:
        RunFailed: what was flown cannot be written, or a worker is lost.
    """
    folder.end_after(None)
    absent = set(folder.missing())
    missing = sorted(absent if part is None else absent.intersection(part))
    done = {k: count(folder.rows(k)) for k in range(len(folder.shards)) if k not in absent}
    total, ending = sum(done.values(), Count()), Ending(until)
    if not ending.reached(done):
        progress(total)
        plan = folder.plan.anywhere()
        tasks = [(plan, reference, folder.shards[k].start, folder.shards[k].stop) for k in missing]
        results = workers(fly_runs, tasks)
        for place, rows in results:
            folder.write(missing[place], rows)
            done[missing[place]] = count(rows)
            total += done[missing[place]]
            progress(total)
            if ending.reached(done):
                break
        results.close()  # type: ignore[attr-defined]
    if ending.reached(done):
        folder.end_after(ending.shard)
        return ending.total
    return total


class Ending:
    """Stopping rule: the first shard up to which the failure probability is known well enough.

    Attributes:
        shard: this one, or the next to be looked at; each is looked at once.
        total: what the runs up to it came to.
    """

    def __init__(self, until: float | None):
        """Create a stopping rule; `until`: half-width of the failure probability's confidence interval, or None."""
        self.shard, self.total = 0, Count()
        self._until, self._reached = until, False

    def reached(self, done: Mapping[int, Count]) -> bool:
        """Return True if these shards suffice."""
        while self._until is not None and not self._reached and self.shard in done:
            self.total += done[self.shard]
            self._reached = self.total.accepted > 0 and self.total.failure.half_width <= self._until
            self.shard += not self._reached
        return self._reached
