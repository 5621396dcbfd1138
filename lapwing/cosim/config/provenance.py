"""Provenance of a log: seed, solver, version, commit, and the resolved run configuration."""

import os
import platform
import subprocess
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import digest, to_json

CONFIG_FILE = "config.json"
MACHINE = ("python", "packages", "system", "processor")  # keys of the recording machine
FAILURE, DIVERGED = "failure", "diverged"  # keys of a run that ended early: the reason, and whether it diverged

_GIT_TIMEOUT = 60.0  # [s] a busy machine needs several seconds; a folder on a server may never answer
WAITED = "waited_for_disk"  # key of a run that waited for the disk: the waiting time


def metadata(config: RunConfig, mode: str) -> dict[str, str]:
    """Return the entries of the log's "lapwing" metadata record, all text."""
    solver = config.resolved.get("solver", {})
    return {
        "scene": config.scene,
        "seed": str(config.seed),
        "mode": mode,
        "vehicle": ", ".join(config.vehicles),
        "config": digest(config),
        "version": package_version(),
        "commit": source_commit(),
        **machine(),
        "exchange_rate": str(config.rate),
        "coupling": config.coupling,
        **{f"solver_{key}": str(value) for key, value in solver.items()},
    }


ENDED = "the run was ended"  # by the user


def failure(text: str, diverged: bool = False) -> dict[str, str]:
    """Return further entries for a run that ended early.

    Args:
        text: reason.
        diverged: True if a state became invalid.
    """
    return {FAILURE: text, **({DIVERGED: "yes"} if diverged else {})}


def attachments(config: RunConfig, sources: Mapping[str, str]) -> dict[str, bytes]:
    """Return the attachments of a log: the run configuration, for resimulation, and its source files."""
    return {CONFIG_FILE: to_json(config).encode(), **{name: text.encode() for name, text in sources.items()}}


def package_version() -> str:
    """Return the version of the installed package, "unknown" if it is not installed."""
    return _installed_version("lapwing")


def machine() -> dict[str, str]:
    """Return versions and processor of this process, by the keys of `MACHINE`."""
    packages = " ".join(f"{name} {_installed_version(name)}" for name in ("numba", "llvmlite", "numpy"))
    library, release = platform.libc_ver()
    values = (platform.python_version(), packages, f"{platform.system()} {library} {release}".strip(), _processor())
    return dict(zip(MACHINE, values, strict=True))


def _installed_version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


def _processor() -> str:
    """Return architecture and model of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    return f"{platform.machine()} {model}".strip()


@cache
def source_commit() -> str:
    """Return the commit of the source tree, with "+" if files differ, or "unknown" if git does not name one."""
    if stated := os.environ.get("LAPWING_COMMIT"):  # set in an image, which has no checkout
        return stated
    here = Path(__file__).parent
    try:
        result = subprocess.run(
            ["git", "-C", str(here), "describe", "--always", "--dirty=+", "--abbrev=12", "--exclude=*"],
            capture_output=True,
            text=True,
            timeout=_GIT_TIMEOUT,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return "unknown"
    return result.stdout.strip() or "unknown"
