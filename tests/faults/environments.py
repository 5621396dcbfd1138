"""Broken environments: a short run in each ends with its digest, or with one line that names the cause."""

import os
import random
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tests.commands import run_command
from tests.faults import leak_checks

ROOT = Path(__file__).parents[2]
RUN = ["run", str(ROOT / "lapwing/scenes/hover.toml"), "--set", "run.duration=0.2", "--set", "success.require=[]"]
COMMAND = 'exec "$@"'
MOUNT = 'exec unshare --mount sh -c \'mount -t tmpfs -o {options} none {folder}; {then} exec "$@"\' sh "$@"'
Script = Callable[[random.Random, Path], str]


def _limit(letter: str, low: int, high: int) -> Script:
    return lambda chance, folder: f"ulimit -{letter} {chance.randint(low, high)}; {COMMAND}"


def _mounted(options: str, then: str = "") -> Script:
    return lambda chance, folder: MOUNT.format(options=options, folder=folder / "disk", then=then)


def _fixed(text: str) -> Script:
    return lambda chance, folder: text.replace("FOLDER", str(folder))


SCRIPTS: dict[str, Script] = {  # shell script by name; "$@" is the command
    "few open files": _limit("n", 8, 64),
    "little address space": _limit("v", 300_000, 2_000_000),
    "small files": _limit("f", 0, 200),
    "little stack": _limit("s", 64, 1024),
    "deleted folder": _fixed(f"mkdir gone; cd gone; rmdir ../gone; {COMMAND}"),
    "closed input": _fixed(f"{COMMAND} <&-"),
    "closed output": _fixed(f"{COMMAND} >&-"),
    "full output": _fixed(f"{COMMAND} > /dev/full"),
    "early reader": _fixed('"$@" | head -c 1 > /dev/null'),
    "no environment": _fixed('exec env -i PYTHONPATH="$PYTHONPATH" PATH="$PATH" TMPDIR="$TMPDIR" "$@"'),
    "ASCII": _fixed(f"export LC_ALL=C PYTHONIOENCODING=ascii PYTHONUTF8=0; {COMMAND} --log FOLDER/ä.mcap"),
    "no home": _fixed(f"export HOME=/nonexistent XDG_STATE_HOME=/nonexistent; {COMMAND}"),
    "no temporary folder": _fixed(f"export TMPDIR=FOLDER/none; {COMMAND}"),
    "log is a folder": _fixed(f"{COMMAND} --log FOLDER"),
    "log is a device": _fixed(f"{COMMAND} --log /dev/full"),
    "unwritable log": _fixed(f"{COMMAND} --log /proc/a.mcap"),
    "read-only disk": _mounted("ro,size=1M", "cd FOLDER/disk;"),
    "small disk": _mounted("size=256k", "cd FOLDER/disk;"),
    "file instead of cache": _fixed(f"touch FOLDER/cache; export LAPWING_CACHE=FOLDER/cache/x; {COMMAND} --help"),
    "masked signals": _fixed(f"trap '' TERM INT HUP PIPE; {COMMAND}"),
}
NEEDS_ROOT = ("read-only disk", "small disk")


class Outcome(NamedTuple):
    """Result of a trial."""

    name: str
    code: int
    wrong: list[str]


def fly(seed: int, timeout: float) -> Outcome:
    """Run in the environment that a seed selects; consecutive seeds cycle through all environments."""
    chance = random.Random(f"environment {seed}")
    names = [name for name in SCRIPTS if os.geteuid() == 0 or name not in NEEDS_ROOT]
    name = names[seed % len(names)]
    with tempfile.TemporaryDirectory(prefix="chaos-") as place:
        folder = Path(place)
        for part in ("disk", "tmp"):
            (folder / part).mkdir()
        script = SCRIPTS[name](chance, folder).replace("FOLDER", str(folder))
        mode = ["--mode", chance.choice(["multi-process", "single-process"])]
        command = ["sh", "-c", script, "sh", sys.executable, "-m", "lapwing", *RUN, *mode]
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(folder / "tmp")}
        try:
            done = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, errors="replace", timeout=timeout
            )
        except subprocess.TimeoutExpired:
            return Outcome(name, -1, [f"has not ended after {timeout:g} s"])
        wrong = leak_checks.left(folder, {}, None, timeout)
    return Outcome(name, done.returncode, wrong + ended_properly(done))


def ended_properly(done: "subprocess.CompletedProcess[str]") -> list[str]:
    """Return the errors at the end of a run: a traceback, another digest, more than one line."""
    if "Traceback" in done.stderr:
        return [f"a traceback: {done.stderr[-300:]}"]
    if done.returncode == 0:
        result = re.search(r"^digest +(\w+)$", done.stdout, re.MULTILINE)
        return [f"another digest: {result[1]}"] if result and result[1] != _digest() else []
    if done.returncode not in (1, 2, 141):
        return [f"exit code {done.returncode}: {done.stderr[-300:]}"]
    lines = done.stderr.count("\n")
    if done.returncode != 141 and (lines != 1 or not done.stderr.startswith("lapwing: ")):
        return [f"{lines} lines: {done.stderr[-300:]}"]
    return []


@cache
def _digest() -> str:
    with tempfile.TemporaryDirectory() as folder:
        done = run_command(*RUN, code=0, folder=folder)
    result = re.search(r"^digest +(\w+)$", done.stdout, re.MULTILINE)
    assert result, done.stdout
    return result[1]
