"""One run with one fault, and the errors in its end."""

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from lapwing.cosim.log import LogReader
from lapwing.services.process_table import required_processes
from lapwing.services.scene_resolver import load, resolve
from tests.faults import campaign, leak_checks, network_partition
from tests.faults.fault_types import FROZEN, FULL, INTERRUPT, KINDS, LAUNCHER
from tests.participants import participants, running

SCENES = {  # overrides that make a flight of a few seconds
    "hover": ["run.duration=5"],
    "delivery_mission": ["run.duration=5"],
    "cooperative_load": ["run.duration=5"],
    "gyrostat_attitude": ["run.duration=5"],
}
LATEST = 9.0  # [s] from the start of the first process to the fault
TIMEOUT = 60.0  # [s] from the fault to the end of the run, and of its processes, on an idle machine
DISK = 1 << 24  # [bytes] of the disk that is filled
RECOVERED = 0.5  # [s] before the fault, up to which a log must be complete


class Trial(NamedTuple):
    """Fault of a trial, derived from a seed."""

    seed: int
    scene: str
    kind: str
    place: float  # participant, in [0, 1); 1: the launcher
    delay: float  # [s] after the start of the first process; Ctrl-C: of the launcher


class Outcome(NamedTuple):
    """Result of a trial."""

    victim: str
    code: int
    text: str
    seconds: float  # from the fault to the end of the last process
    wrong: list[str]


def draw(seed: int, kinds: Sequence[str] | None = None) -> Trial:
    """Return the trial of a seed; `kinds` are the kinds to choose from, None for all."""
    chance = random.Random(seed)
    every = [*KINDS, *network_partition.KINDS] if os.geteuid() == 0 else [kind for kind in KINDS if kind != FULL]
    kind = chance.choice(kinds or every)
    launcher = kind not in (FULL, *campaign.KINDS) and chance.random() < 0.2
    place = 1.0 if kind == INTERRUPT or launcher else chance.random()
    scenes = ["hover"] if kind in campaign.KINDS else sorted(SCENES)
    return Trial(seed, chance.choice(scenes), kind, place, chance.uniform(0.2, LATEST))


def fly(trial: Trial, timeout: float = TIMEOUT) -> Outcome:
    """Run a trial in a new folder; `timeout` [s] limits the time from the fault to the end."""
    folder = Path(tempfile.mkdtemp(prefix="faults-"))
    disk = folder / "disk"
    disk.mkdir()
    full = trial.kind == FULL
    try:
        if trial.kind in network_partition.KINDS:
            victim = network_partition.HOSTS[
                min(int(trial.place * len(network_partition.HOSTS)), len(network_partition.HOSTS) - 1)
            ]
            code, output, seconds, wrong = network_partition.fly(victim, trial.kind, trial.delay / 2, folder)
            return Outcome(victim, code, output, seconds, wrong + leak_checks.left(folder, {}, None, timeout))
        if trial.kind in campaign.KINDS:
            cold = trial.seed % 2 == 1
            return Outcome(*campaign.fly(trial.kind, trial.place, trial.delay, cold, folder, timeout))
        if full:
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", disk], check=True)
        return _fly(trial, folder, disk / "log.mcap", timeout)
    finally:
        if full:
            subprocess.run(["umount", "--lazy", disk], check=False)
        shutil.rmtree(folder, ignore_errors=True)


def _fly(trial: Trial, folder: Path, log: Path, timeout: float) -> Outcome:
    sets = [part for override in SCENES[trial.scene] for part in ("--set", override)]
    command = [sys.executable, "-m", "lapwing", "run", trial.scene, *sets, "--speed", "1", "--log", str(log)]
    at_once = trial.kind == INTERRUPT
    cold = {"LAPWING_CACHE": str(folder / "cache")} if at_once and trial.seed % 2 else {}
    with (folder / "said").open("w+") as output:
        launcher = subprocess.Popen(
            [*command, "--set", "success.require=[]", "--report", str(folder / "report.html")],
            stdout=subprocess.DEVNULL,
            stderr=output,
            env={**os.environ, "TMPDIR": str(folder), **cold},
            cwd=Path(__file__).parents[2],
        )
        while not at_once and not participants(launcher.pid) and launcher.poll() is None:
            time.sleep(0.05)
        time.sleep(trial.delay)
        children = participants(launcher.pid)
        all_pids = {**children, LAUNCHER: launcher.pid}
        names = [name for name in sorted(children) if name in _needed(trial.scene)]  # the others end early
        victim = names[int(trial.place * len(names))] if trial.place < 1.0 and names else LAUNCHER
        late = launcher.poll() is not None
        taken = leak_checks.ports(leak_checks.of_trial(folder))
        if trial.kind == FULL:
            victim = "recorder"
            _fill(log.with_name("filler"))
        else:
            KINDS[trial.kind].strike(all_pids[victim])
        struck = time.monotonic()
        if (victim, trial.kind) == (LAUNCHER, "freeze"):
            _gone(participants(launcher.pid) | children, FROZEN)
            os.kill(launcher.pid, signal.SIGCONT)
        wrong = leak_checks.ended(launcher, "launcher", timeout)
        left = _gone(children, timeout)
        seconds = time.monotonic() - struck
        wrong += [f"{name} is left" for name in left]
        for name in left:
            with suppress(ProcessLookupError):
                os.kill(children[name], signal.SIGKILL)
        wrong += leak_checks.left(folder, taken, Path(cold["LAPWING_CACHE"]) if cold else None, timeout)
        output.seek(0)
        text = output.read()
    code = launcher.returncode
    wrong += _wrong_end(trial, victim, code, text, late)
    wrong += _wrong_log(trial, victim, log, text, late)
    if stuck := [path.name for path in folder.glob("lapwing-*")]:
        wrong.append(f"left behind: {', '.join(stuck)}")
    return Outcome(victim, code, text.strip(), seconds, wrong)


def _wrong_end(trial: Trial, victim: str, code: int, text: str, late: bool) -> list[str]:
    over = (code, text) == (0, "")  # it ended before the fault
    if "Traceback" in text:
        return [f"a traceback: {text}"]
    if victim == LAUNCHER and trial.kind == "kill":
        return [] if code == -signal.SIGKILL or (late and over) else [f"exit code {code}"]
    if victim == LAUNCHER and trial.kind == "freeze":
        return [] if code in (0, 1) else [f"exit code {code}: {text}"]
    result = KINDS[trial.kind].ends(victim, code, text)
    return [result] if result and not over else []


def _wrong_log(trial: Trial, victim: str, log: Path, text: str, late: bool) -> list[str]:
    """Return an error unless the log opens and reaches to `RECOVERED` before the fault."""
    _, _, stated = text.partition("at t = ")
    flight = float(stated.split()[0].rstrip(":;,")) if stated else 0.0
    if victim == "recorder":  # the others continue until one waits, and the time is theirs
        flight = min(flight, RECOVERED)
    if flight < RECOVERED and not (trial.kind == INTERRUPT and log.exists()):
        return []  # a log may be missing
    try:
        with LogReader(log) as read:
            last = max((time_ns for _, _, time_ns, _ in read.messages()), default=0) * 1e-9
    except ValueError as error:
        return [str(error)]
    return [] if last >= flight - RECOVERED else [f"the log ends at {last:.3f} s, struck at {flight:.3f} s"]


@cache
def _needed(scene: str) -> list[str]:
    """Return the required processes of a scene."""
    return required_processes(resolve(load(scene, SCENES[scene])))


def _fill(path: Path) -> None:
    """Fill a disk."""
    with suppress(OSError), path.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def _gone(pids: dict[str, int], seconds: float) -> list[str]:
    """Return the processes that remain after at most `seconds`."""
    deadline = time.monotonic() + seconds
    while (left := [name for name, pid in pids.items() if running(pid)]) and time.monotonic() < deadline:
        time.sleep(0.05)
    return left
