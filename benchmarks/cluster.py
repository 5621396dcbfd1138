"""Cost of a shard for a Dask scheduler and the waiting command: the number of workers that one can serve.

    python -m benchmarks.cluster [--shards N]

Shards of 250 runs with immediate results, on one worker; scheduler and command run in this process. It needs
`pip install lapwing[cluster]`.
"""

import time

from benchmarks._command import command_line
from lapwing.flights.metrics import METRICS
from lapwing.studies.campaign.folder import MAX_SHARD_SIZE as RUNS
from lapwing.studies.workers import dask


def rows(shard):
    """Return synthetic rows of a shard with the columns of a flight."""
    numbers = {name: 1.0 / (1 + k) for k, name in enumerate(METRICS)}
    return [{"run": RUNS * shard + k, "seed": k + 1, **numbers} for k in range(RUNS)]


def main(shards: int = 2000) -> None:
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        began = time.process_time()
        for _ in dask(cluster.scheduler_address)(rows, [(k,) for k in range(shards)]):
            pass
        each = (time.process_time() - began) / shards
    print(f"{1e3 * each:.2f} ms of processor time for a shard: {1 / each:.0f} shards, {RUNS / each:.0f} runs a second")


if __name__ == "__main__":
    command_line(main)
