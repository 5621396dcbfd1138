"""Runs with a random fault of a random participant at a random time.

    python -m tests.faults --seed S --trials N [--jobs J] [--timeout SECONDS] [--kinds KIND ...]

Each trial depends on one seed only (S, S+1, ...); repeat it with `--seed SEED --trials 1`. Exit code 1 if a trial
does not end as specified.
"""

import argparse
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from tests.faults.trial import TIMEOUT, draw, fly


def main() -> None:
    """Run the trials and print the counts."""
    parser = argparse.ArgumentParser(description="Runs with faults at random instants under random participants.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=1, help="trials at once")
    parser.add_argument("--timeout", type=float, default=TIMEOUT, help="[s] for an end; more on a busy machine")
    parser.add_argument("--kinds", nargs="+", help="leave out all others")
    values = parser.parse_args()
    trials = [draw(values.seed + k, values.kinds) for k in range(values.trials)]
    counts: Counter = Counter()
    longest: dict[str, float] = {}
    with ThreadPoolExecutor(values.jobs) as pool:
        for trial, outcome in zip(trials, pool.map(partial(fly, timeout=values.timeout), trials), strict=True):
            counts[trial.kind, not outcome.wrong] += 1
            longest[trial.kind] = max(longest.get(trial.kind, 0.0), outcome.seconds)
            words = "; ".join(outcome.wrong) or "ok"
            where = f"{trial.seed:6d} {trial.scene:18s} {trial.kind:15s} {outcome.victim:10s} {trial.delay:4.1f} s"
            print(f"{where}  exit code {outcome.code:3d} after {outcome.seconds:4.1f} s  {words}", flush=True)
    for kind in sorted(longest):
        right, wrong = counts[kind, True], counts[kind, False]
        print(f"{kind}: {right} of {right + wrong} as they should be, the longest end {longest[kind]:.1f} s")
    raise SystemExit(any(not right for _, right in counts))


if __name__ == "__main__":
    main()
