"""Runs of the studio: processes of `lapwing run`, their output and results."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

from lapwing.views.studio.scene_forms import Change, command_line

LINES = 400  # stored lines of the output
END_TIMEOUT = 10.0  # [s] from SIGINT to SIGKILL
_LIVE = re.compile(r"live: (http://127\.0\.0\.1:\d+/[\w-]+/)$")
_TIME = re.compile(r"t =\s*([\d.]+) s\s+([\d.]+)x")


class StudioRun:
    """One run of a scene with changes."""

    def __init__(self, number: int, scene: str, changed: Sequence[Change], speed: str, view: bool, folder: Path):
        """Start `lapwing run`; `folder` is that of its JSON result."""
        self.number, self.scene, self.changed, self.speed, self.view = number, scene, tuple(changed), speed, view
        self.command = command_line(scene, changed, speed, view)
        self.lines: list[str] = []
        self.live = ""  # address of the 3D view
        self.sim_time, self.rate = 0.0, 0.0  # [s]; simulation time over wall time
        self.result: dict[str, Any] = {}
        self.code: int | None = None
        self._json = folder / f"{number}.json"
        self.stopped = False  # True if the user ended the run
        words = [sys.executable, "-m", "lapwing", *self.command[1:], "--json", str(self._json)]
        self._process = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            # BROWSER=true opens no window, since the page shows the view; the output is unbuffered
            env=os.environ | {"BROWSER": "true", "COLUMNS": "100", "PYTHONUNBUFFERED": "1"},
            start_new_session=True,  # Ctrl-C ends the page, which ends the run
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            line = line.rstrip("\n")
            if match := _LIVE.match(line):
                self.live = match[1]
            elif match := _TIME.match(line):
                self.sim_time, self.rate = float(match[1]), float(match[2])
            else:
                self.lines = [*self.lines[-LINES:], line]
        code = self._process.wait()
        with suppress(OSError, ValueError):  # a failed run has no result
            self.result = json.loads(self._json.read_text(encoding="utf-8"))
        self.live, self.code = "", code

    @property
    def running(self) -> bool:
        """True until the process has ended and its result has been read."""
        return self.code is None

    @property
    def log(self) -> Path | None:
        """Path of the log; None without one."""
        return Path(self.result["log"]) if "log" in self.result else None

    @property
    def error(self) -> str:
        """Last line of the output of a run that failed without a result; "" otherwise."""
        if self.running or not self.code or self.result:
            return ""
        last = next((line for line in reversed(self.lines) if line.strip()), "")
        return last.removeprefix("lapwing: ") or f"ended with exit code {self.code}"

    def state(self) -> dict[str, Any]:
        """Return the state that the page polls."""
        return {
            "running": self.running,
            "live": self.live,
            "time": self.sim_time,
            "rate": self.rate,
            "lines": self.lines[-12:],
        }

    def stop(self) -> None:
        """Interrupt the run, which then writes its log and report."""
        if self._process.poll() is None:
            self.stopped = True
            self._process.send_signal(signal.SIGINT)

    def end(self) -> None:
        """Interrupt the run and wait; kill its processes if it does not end."""
        self.stop()
        try:
            self._process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._reader.join(END_TIMEOUT)


class StudioRuns:
    """Runs of the studio, one at a time; a context manager that ends the current run."""

    def __init__(self) -> None:
        """Create a folder for results."""
        self._folder = tempfile.TemporaryDirectory(prefix="lapwing-studio-")
        self._numbers, self._lock = count(1), threading.Lock()
        self.all: dict[int, StudioRun] = {}

    @property
    def folder(self) -> Path:
        """Folder for temporary files, deleted at the end."""
        return Path(self._folder.name)

    @property
    def current(self) -> StudioRun | None:
        """Current run; None without one."""
        return next((run for run in self.all.values() if run.running), None)

    def start(self, scene: str, changed: Sequence[Change], speed: str, view: bool) -> StudioRun:
        """Start a run. Raise ValueError if another one is running."""
        with self._lock:
            if (other := self.current) is not None:
                raise ValueError(f"run {other.number} of {other.scene} is still running; stop it first")
            number = next(self._numbers)
            self.all[number] = StudioRun(number, scene, changed, speed, view, self.folder)
            return self.all[number]

    def __enter__(self) -> "StudioRuns":
        return self

    def __exit__(self, *_: object) -> None:
        for run in self.all.values():
            if run.running:
                run.end()
        self._folder.cleanup()
