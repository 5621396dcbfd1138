"""Install a wheel into an empty environment for each available Python, check its top-level names, and fly."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

PYTHONS = ("python3.11", "python3.12", "python3.13", "python3.14")


def available() -> list[str]:
    """Return the installed Pythons; a shim of a version manager may have none behind it."""
    paths = [path for name in PYTHONS if (path := shutil.which(name))]
    return [path for path in paths if not subprocess.run([path, "-c", ""], stderr=subprocess.DEVNULL).returncode]


def check(python: str, wheel: Path) -> None:
    """Install the wheel and fly hover with it from an empty folder.

    Raises:
        subprocess.CalledProcessError: a step failed.
        SystemExit: the wheel installs a top-level name other than `lapwing`.
    """
    with tempfile.TemporaryDirectory() as folder:
        environment, work = Path(folder) / "venv", Path(folder) / "work"
        work.mkdir()
        subprocess.run([python, "-m", "venv", environment], check=True)
        pip = [environment / "bin/python", "-m", "pip", "--quiet", "--disable-pip-version-check"]
        site = Path(
            subprocess.check_output(
                [*pip[:1], "-c", "import site; print(site.getsitepackages()[0])"], text=True
            ).strip()
        )
        before = {path.name for path in site.iterdir()}
        subprocess.run([*pip, "install", "--no-deps", wheel], check=True)
        added = {path.name for path in site.iterdir()} - before
        if {name for name in added if not name.endswith(".dist-info")} != {"lapwing"}:
            raise SystemExit(f"{wheel.name}: installs {', '.join(sorted(added))}; expected lapwing alone")
        subprocess.run([*pip, "install", wheel], check=True)
        subprocess.run([environment / "bin/lapwing", "run", "hover", "--mode", "single-process"], cwd=work, check=True)
        print(f"{python}: {wheel.name} installs one package and flies")


if __name__ == "__main__":
    for python in available() or [sys.executable]:
        check(python, Path(sys.argv[1]).resolve())
