"""All benchmarks one after the other, and at the end every figure that has a bar beside it: `make bench`.

    python -m benchmarks [--quick] [NAME...]

Each module of this folder with a `main()` is one; what it returns are its rows of the table.
"""

import argparse
import sys
import traceback

import benchmarks
from benchmarks._targets import show
from lapwing.dynamics import discovery

measured = discovery.modules(benchmarks)
parser = argparse.ArgumentParser(prog="python -m benchmarks")
parser.add_argument("names", metavar="NAME", nargs="*", help=f"one of {', '.join(measured)}; all if none is named")
parser.add_argument("--quick", action="store_true", help="leave out those that take many minutes")
options = parser.parse_args()
if unknown := set(options.names) - measured.keys():
    parser.error(f"unknown benchmark {', '.join(sorted(unknown))}; expected one of {', '.join(measured)}")
rows, failed = [], []
for name, module in measured.items():
    if (options.names and name not in options.names) or (options.quick and getattr(module, "SLOW", False)):
        continue
    print(f"== {name}", flush=True)
    try:
        rows += module.main() or []
    except Exception:  # what the others have measured for an hour is shown all the same
        traceback.print_exc()
        failed.append(name)
print("== beside their bars")
show(rows)
if failed:
    sys.exit(f"not measured: {', '.join(failed)}")
