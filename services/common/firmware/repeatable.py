"""Library that makes a firmware repeatable (`repeatable.c`): compiled at first use, preloaded, and observed."""

import hashlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from lapwing.kernels.compiler import cache_files

SOURCE = Path(__file__).with_suffix(".c")
OPTIONS = ("-O2", "-shared", "-fPIC", "-pthread", "-w")
NO_COMPILER = "no C compiler; install gcc, or pip install ziglang"
ELSEWHERE = "Lapwing did not start it"
OFF, SHELL = "autopilot.repeatable = false", "its shell is connected"
NOT_LOADED = "the program does not load a library, as a static one or a script that starts another process"
NOT_LINKED = "its connection is not made by calls of the C library that are known here"


class Turns(NamedTuple):
    """Settings of the library for a firmware; see `repeatable.c`."""

    kind: str  # how the link to Lapwing begins: the firmware "c"onnects, "s"ends or "b"inds
    port: int  # to or at which it does
    step_ns: int  # [ns] by which a message of the link moves the clock
    peers: tuple[int, ...]  # ports of Lapwing's other messages: from a datagram port, to a stream port
    idle: bytes = b""  # answer for a step in which the firmware sends none
    answer_port: int = 0  # to which datagrams are sent, if they are not sent by the socket of the link
    start_ns: int = 0  # [ns] virtual time before the first message
    read_ns: int = 0  # [ns] by which a reading moves the clock


def compilers() -> list[list[str]]:
    """Return the commands of the C compilers on this machine, the preferred one first."""
    names = filter(None, (os.environ.get("CC"), "cc", "gcc", "clang"))
    found = [[path] for name in names if (path := shutil.which(name))]
    return found + ([[sys.executable, "-m", "ziglang", "cc"]] if find_spec("ziglang") else [])


def library() -> Path:
    """Return the compiled library; it is kept in Lapwing's cache.

    Raises:
        OSError: no compiler, or it cannot compile the library; the text is for the user.
    """
    root = cache_files.root()
    if sys.platform != "linux" or root is None:
        raise OSError("needs Linux and a home folder")
    source = SOURCE.read_bytes()
    path = root / "firmware" / f"repeatable-{hashlib.blake2b(source, digest_size=8).hexdigest()}.so"
    if path.is_file() and path.stat().st_uid == os.geteuid():
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    text = ""
    for command in compilers():
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:
            new = Path(folder) / path.name
            arguments = [*command, *OPTIONS, "-o", str(new), str(SOURCE), "-ldl"]
            done = subprocess.run(arguments, capture_output=True, text=True, check=False)
            if done.returncode == 0:
                new.replace(path)
                return path
            text = text or f"{command[0]} fails: {(done.stderr.strip() or 'no message').splitlines()[0]}"
    raise OSError(text or NO_COMPILER)


class Repeatable:
    """Library in a running program.

    Attributes:
        linked: True once the firmware has opened the link.
        ready: True once all of its threads wait for the first message.
        foreign: what makes the flight not repeatable, "" if nothing has.
        stuck: name of a thread that does not let others run, "" if there is none.
    """

    def __init__(self, path: Path, turns: Turns, seed: int):
        """Prepare the start of a program; `seed`: order of its threads, 0: in turn."""
        self._own, self.child = socket.socketpair()
        self._own.setblocking(False)
        self.attached = self.linked = self.ready = False
        self.foreign = self.stuck = self._rest = ""
        peers = "".join(f",{port}" for port in turns.peers) + ","
        times = (turns.step_ns, turns.start_ns, turns.read_ns, seed, turns.idle.hex() or "-", peers)
        setting = (os.getpid(), self.child.fileno(), turns.kind, turns.port, turns.answer_port, *times)
        preload = ":".join(filter(None, (str(path), os.environ.get("LD_PRELOAD"))))
        self.environment = {"LD_PRELOAD": preload, "LAPWING_REPEATABLE": " ".join(map(str, setting))}

    def read(self) -> None:
        """Process what the library has reported."""
        with suppress(OSError):
            while data := self._own.recv(4096):
                *lines, self._rest = (self._rest + data.decode(errors="replace")).split("\n")
                for line in lines:
                    name, _, text = line.partition(" ")
                    setattr(self, name, getattr(self, name) or text or True)

    @property
    def problem(self) -> str:
        """Reason why the flight is not repeatable once the firmware has opened the link, "" if it is."""
        self.read()
        return self.foreign or ("" if self.linked else NOT_LINKED if self.attached else NOT_LOADED)

    def close(self) -> None:
        """Let the clock of the program run freely, so that it can end."""
        self._own.close()
        self.child.close()
