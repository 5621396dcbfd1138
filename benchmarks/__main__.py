"""All benchmarks one after another, and a table of all figures with targets: `make bench`.

    python -m benchmarks [--quick] [NAME...]

A benchmark is a module of this folder with a `main()` that returns its rows of the table.
"""

import argparse
import inspect
import sys
import traceback

import benchmarks
from benchmarks._targets import show
from lapwing.dynamics import discovery

modules_by_name = discovery.modules(benchmarks)
parser = argparse.ArgumentParser(prog="python -m benchmarks")
parser.add_argument("names", metavar="NAME", nargs="*", help=f"one of {', '.join(modules_by_name)}; default: all")
parser.add_argument("--quick", action="store_true", help="skip benchmarks that take many minutes")
options = parser.parse_args()
if unknown := set(options.names) - modules_by_name.keys():
    parser.error(f"unknown benchmark {', '.join(sorted(unknown))}; expected one of {', '.join(modules_by_name)}")
rows, failed = [], []
for name, module in modules_by_name.items():
    if (options.names and name not in options.names) or (options.quick and getattr(module, "SLOW", False)):
        continue
    if any(parameter.default is parameter.empty for parameter in inspect.signature(module.main).parameters.values()):
        print(f"== {name}: skipped, it needs files of recorded flights (python -m benchmarks.{name} --help)")
        continue
    print(f"== {name}", flush=True)
    try:
        rows += module.main() or []
    except Exception:  # the results of the other benchmarks are still shown
        traceback.print_exc()
        failed.append(name)
print("== targets")
show(rows)
if failed:
    sys.exit(f"not measured: {', '.join(failed)}")
