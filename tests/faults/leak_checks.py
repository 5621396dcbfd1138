"""Leak checks after a trial: processes, ports, locks of the kernel cache."""

import fcntl
import os
import subprocess
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from lapwing.kernels import cache_folder

LOCKS = "compiling"  # folder of the cache (lapwing.kernels.compiler.file_locks)
TABLES = ("tcp", "tcp6", "udp", "udp6", "unix")


def of_trial(folder: Path) -> dict[int, str]:
    """Return the names of a trial's processes by id: those with its folder in environment or command line."""
    result, mark = {}, os.fsencode(folder)
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            values = (place / "cmdline").read_bytes() + (place / "environ").read_bytes()
            ended = (place / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
            if mark in values and not ended:
                result[int(place.name)] = (place / "comm").read_text().strip()
    return result


def ports(processes: Iterable[int]) -> dict[str, str]:
    """Return the sockets at which processes listen or receive, by inode."""
    inodes = set()
    for process in processes:
        with suppress(OSError):
            for file in Path(f"/proc/{process}/fd").iterdir():
                with suppress(OSError):
                    inodes.add(os.readlink(file).removeprefix("socket:[").removesuffix("]"))
    return {inode: name for inode, name in _bound().items() if inode in inodes}


def _bound() -> dict[str, str]:
    """Return every bound socket of this machine without a peer, by inode."""
    result = {}
    for table in TABLES:
        with suppress(OSError):
            for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
                words = line.split()
                if table == "unix":
                    if len(words) > 7 and int(words[3], 16) & 0x10000:  # listening
                        result[words[6]] = f"{table} {words[7]}"
                elif words[3] == ("0A" if table.startswith("tcp") else "07"):
                    result[words[9]] = f"{table} port {int(words[1].rpartition(':')[2], 16)}"
    return result


def ended(process: subprocess.Popen, name: str, seconds: float) -> list[str]:
    """Wait for a process; kill it and return an error if it has not ended after `seconds`."""
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return [f"the {name} has not ended after {seconds:g} s"]
    return []


def left(folder: Path, taken: dict[str, str], cache: Path | None, seconds: float) -> list[str]:
    """Return the leaks that remain after `seconds`.

    Args:
        folder: folder of the trial.
        taken: ports that its processes had.
        cache: its kernel cache, or None for the shared cache.
        seconds: time to wait.
    """
    deadline = time.monotonic() + seconds
    while (result := _left(folder, taken, cache)) and time.monotonic() < deadline:
        time.sleep(0.1)
    return result


def _left(folder: Path, taken: dict[str, str], cache: Path | None) -> list[str]:
    there = _bound()
    return [
        *(f"process {number} ({name}) is left" for number, name in of_trial(folder).items()),
        *(f"{name} stays taken" for inode, name in taken.items() if inode in there),
        *(f"the lock {name} stays taken" for name in locked(cache or Path(cache_folder() or folder))),
    ]


def locked(cache: Path) -> list[str]:
    """Return the held locks of a kernel cache whose holder has ended; other programs may use the cache too."""
    result, holders = [], _holders()
    for path in sorted((cache / LOCKS).glob("*")):
        with suppress(OSError):
            descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if not Path(f"/proc/{holders.get(os.fstat(descriptor).st_ino)}").exists():
                    result.append(path.name)
            finally:
                os.close(descriptor)
    return result


def _holders() -> dict[int, str]:
    """Return the holder of each file lock, by the file's inode."""
    lines = [line.split() for line in Path("/proc/locks").read_text().splitlines()]
    return {int(words[5].rpartition(":")[2]): words[4] for words in lines if words[1] == "FLOCK"}
