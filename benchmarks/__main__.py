"""All benchmarks one after another, and a table of all figures with targets: `make bench`.

    python -m benchmarks [--quick] [NAMES...]

A benchmark is a module of this folder with a `main()` that returns its rows of the table.
"""

import inspect
import sys
import traceback
from typing import Annotated

import typer

import benchmarks
from benchmarks._command import command_line
from benchmarks._targets import show
from lapwing.dynamics import discovery

MODULES = discovery.modules(benchmarks)


def main(
    names: Annotated[list[str] | None, typer.Argument(help=f"some of {', '.join(MODULES)}; default: all")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="skip benchmarks that take many minutes")] = False,
) -> None:
    if unknown := set(names or ()) - MODULES.keys():
        raise typer.BadParameter(
            f"unknown benchmark {', '.join(sorted(unknown))}; expected one of {', '.join(MODULES)}"
        )
    rows, failed = [], []
    for name, module in MODULES.items():
        if (names and name not in names) or (quick and getattr(module, "SLOW", False)):
            continue
        if any(
            parameter.default is parameter.empty for parameter in inspect.signature(module.main).parameters.values()
        ):
            print(f"== {name}: skipped, it has required arguments (python -m benchmarks.{name} --help)")
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


command_line(main)
