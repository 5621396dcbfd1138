"""Fly scene `hover` with the oldest and the newest dependencies that pyproject.toml allows, and compare the digests.

Each set is installed in a virtual environment below build/compatibility. The third flight uses the newest set with a
version of numba that the compile pipeline does not know. Exit code 1 if a flight fails or a digest differs from the
golden one.

    python deploy/compatibility.py [--python PYTHON]
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "build" / "compatibility"
TESTED = ("numba", "numpy", "eclipse-zenoh", "pydantic", "typer")
UNKNOWN_NUMBA = 'import numba; numba.__version__ = "9.9.0"\n'


def oldest() -> list[str]:
    """Return pip requirements that pin each tested package to the lower bound in pyproject.toml."""
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    bounds = dict(match.groups() for text in declared if (match := re.match(r"([\w-]+)>=([\w.]+)", text)))
    return [f"{name}=={bounds[name]}" for name in TESTED]


def install(name: str, python: str, requirements: list[str]) -> Path:
    """Return the interpreter of a virtual environment with this project and the required packages."""
    folder = FOLDER / name
    interpreter = folder / "bin" / "python"
    subprocess.run([python, "-m", "venv", "--clear", folder], check=True)
    pip = [interpreter, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, *requirements, str(ROOT)], check=True)
    shutil.rmtree(ROOT / "build" / "lib", ignore_errors=True)  # left by the build of the wheel
    return interpreter


def versions(interpreter: Path) -> str:
    """Return the installed versions of Python and the tested packages."""
    code = "import importlib.metadata as m, platform, sys; print('Python', platform.python_version(), *sum(("
    code += "[name, m.version(name)] for name in sys.argv[1:]), []))"
    run = subprocess.run([interpreter, "-c", code, *TESTED, "llvmlite"], check=True, capture_output=True, text=True)
    return run.stdout.strip()


def fly(name: str, interpreter: Path) -> str:
    """Return the digest of scene hover; the kernels come from a cache of this environment."""
    folder = FOLDER / f"flight_{name}"
    folder.mkdir(parents=True, exist_ok=True)
    settings = {key: value for key, value in os.environ.items() if not key.startswith(("NUMBA", "PYTHON"))}
    settings["LAPWING_CACHE"] = str(folder / "cache")
    if name == "fallback":
        (folder / "sitecustomize.py").write_text(UNKNOWN_NUMBA, encoding="utf-8")
        settings["PYTHONPATH"] = str(folder)
    summary = folder / "summary.json"
    command = [interpreter, "-m", "lapwing", "run", "hover", "--json", summary, "--log", folder / "hover.mcap"]
    subprocess.run(command, check=True, env=settings, cwd=folder, stdout=subprocess.DEVNULL)
    return json.loads(summary.read_text(encoding="utf-8"))["digest"]


def main() -> int:
    """Fly with each set of dependencies and print one line for each."""
    parser = argparse.ArgumentParser(description="Compare flights with the oldest and newest dependencies.")
    parser.add_argument("--python", default=sys.executable, help="interpreter of the environments")
    python = parser.parse_args().python
    golden = tomllib.loads((ROOT / "tests/golden/digests.toml").read_text(encoding="utf-8"))["hover"]["digest"]
    newest = install("newest", python, [])
    flights = {"oldest": install("oldest", python, oldest()), "newest": newest, "fallback": newest}
    failed = False
    for name, interpreter in flights.items():
        try:
            digest = fly(name, interpreter)
        except subprocess.CalledProcessError as error:
            digest = f"exit code {error.returncode}"
        failed |= digest != golden
        verdict = "equal" if digest == golden else f"DIFFERENT, expected {golden}"
        print(f"{name}: {versions(interpreter)}: {digest}: {verdict}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
