"""What a log says about its own making: seed, solver, version, commit, and all that was resolved."""

import os
import subprocess
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import digest, to_json

SETUP_FILE = "setup.json"
FAILURE, DIVERGED = "failure", "diverged"  # keys of a run that ended before its time: why, and whether it diverged

WAITED = "waited_for_disk"  # key of a run that the disk has held up: for how long


def metadata(setup: RunConfig, mode: str) -> dict[str, str]:
    """The entries of the log's "lapwing" metadata record, all text."""
    solver = setup.resolved.get("solver", {})
    return {
        "scene": setup.scene,
        "seed": str(setup.seed),
        "mode": mode,
        "vehicle": ", ".join(setup.vehicles),
        "setup": digest(setup),
        "version": package_version(),
        "commit": _commit(),
        "exchange_rate": str(setup.rate),
        "coupling": setup.coupling,
        **{f"solver_{key}": str(value) for key, value in solver.items()},
    }


def failure(text: str, diverged: bool = False) -> dict[str, str]:
    """Further entries for a run that ended before its time.

    Args:
        text: why.
        diverged: whether a state was no longer sound.
    """
    return {FAILURE: text, **({DIVERGED: "yes"} if diverged else {})}


def attachments(setup: RunConfig, sources: Mapping[str, str]) -> dict[str, bytes]:
    """Files that travel inside the log: the set-up, from which the run can be flown again, and its sources."""
    return {SETUP_FILE: to_json(setup).encode(), **{name: text.encode() for name, text in sources.items()}}


def package_version() -> str:
    """Version of the installed package, "unknown" where it is not installed."""
    try:
        return version("lapwing")
    except PackageNotFoundError:
        return "unknown"


def _commit() -> str:
    """The commit of the source tree; with "+" when files differ from it, "unknown" outside a git checkout."""
    if stated := os.environ.get("LAPWING_COMMIT"):  # in an image, which has no checkout
        return stated
    here = Path(__file__).parent
    try:
        result = subprocess.run(
            ["git", "-C", str(here), "describe", "--always", "--dirty=+", "--abbrev=12", "--exclude=*"],
            capture_output=True,
            text=True,
            timeout=5,
            check=False,
        )
    except OSError:
        return "unknown"
    return result.stdout.strip() or "unknown"
