"""What a log says about its own making: seed, solver, version, commit, and the scene itself."""

import os
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from services.scene import Scene, sections
from services.sections import Exchange, Run, Vehicle


def metadata(scene: Scene, mode: str) -> dict[str, str]:
    """The entries of the log's "lapwing" metadata record, all text."""
    solver = scene[sections()["solver"]].model_dump()  # the plant's table; what it holds is the plant's affair
    return {
        "scene": scene.name,
        "folder": str(scene.path.parent),
        "seed": str(scene[Run].seed),
        "mode": mode,
        "model": scene[Vehicle].model,
        "version": package_version(),
        "commit": _commit(),
        "exchange_rate": str(scene[Exchange].rate),
        "coupling": scene[Exchange].coupling,
        **{f"solver_{key}": str(value) for key, value in solver.items()},
    }


def attachments(scene: Scene) -> dict[str, bytes]:
    """Files that travel inside the log: the scene as it was flown."""
    return {"scene.toml": scene.text.encode()}


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
