"""Damaged bytes for all readers of external bytes.

    python -m tests.fuzz [--inputs N | --seconds S] [--seed S] [TARGET ...]

Exit code 1 if an input raises an exception other than ValueError, or takes longer than a second of processor time.
"""

import argparse
import random
import resource
import time

from tests.fuzz.mutate import mutated
from tests.fuzz.targets import TARGETS

SLOW = 1.0  # [s] of processor time for one input


def main() -> None:
    """Run the inputs and print the counts."""
    parser = argparse.ArgumentParser(description="Damaged bytes for everything that reads bytes from outside.")
    parser.add_argument("--inputs", type=int, default=1000, help="for each target")
    parser.add_argument("--seconds", type=float, help="of processor time for each target, instead of --inputs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    values = parser.parse_args()
    wrong = 0
    for name in values.targets or TARGETS:
        target, chance = TARGETS[name](), random.Random(f"{name} {values.seed}")
        for seed in target.seeds:  # loads modules before the memory is measured
            target.read(seed)
        refused, slowest = 0, 0.0
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        has_started = started = time.process_time()
        number = 0
        while (time.process_time() - has_started < values.seconds) if values.seconds else number < values.inputs:
            number += 1
            data = mutated(chance, target.seeds)
            try:
                target.read(data)
            except ValueError:
                refused += 1
            except Exception as error:
                wrong += 1
                print(f"{name}: input {number}: {type(error).__name__}: {error!s:.100}: {data[:60]!r}", flush=True)
            slowest, started = max(slowest, (now := time.process_time()) - started), now
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        wrong += slowest > SLOW
        rate = number / (started - has_started)
        shares = f"{refused} refused, {number - refused} taken"
        print(f"{name}: {number} inputs, {shares}, slowest {1e3 * slowest:.0f} ms, +{grown:.0f} MB, {rate:.0f}/s")
    raise SystemExit(wrong > 0)


if __name__ == "__main__":
    main()
