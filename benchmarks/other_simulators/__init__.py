"""Other simulators on Lapwing's problems: `accuracy` (used by `benchmarks.accuracy`) and `stability`.

    python -m benchmarks.other_simulators [CASES...]

Each folder has one file per simulator. A simulator whose package is not installed is skipped.
"""

from types import ModuleType
from typing import Annotated

from typer import Argument

from lapwing.dynamics import discovery

SLOW = True


def installed(package: str) -> list[ModuleType]:
    """Return the modules of a folder whose simulator is installed; print the names of the others."""
    modules = []
    for name in discovery.names(package):
        try:
            modules.append(discovery.get(package, name, "simulator"))
        except ImportError as missing:
            print(f"{name}: skipped, {missing}")
    return modules


def main(cases: Annotated[list[str] | None, Argument()] = None) -> None:
    from benchmarks.other_simulators import stability

    stability.main(cases or ())
