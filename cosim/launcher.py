"""Starts the services of a scene as processes, watches them, and ends them all together."""

import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import IO, Any

from cosim.bus import ZenohBus, mesh
from cosim.watch import STALL, WATCHER, Watch

GRACE = 1.5  # [s] a process gets to end after SIGTERM
FAREWELL = 10.0  # [s] the processes get to end by themselves after the last tick
PARTICIPANT = "services.participant"  # the module that a child runs
REFUSED = 2  # exit code of a service whose user can mend what is wrong


class RunFailed(RuntimeError):
    """A run that did not reach its end; the text names the culprit."""


def loopback_endpoints(names: Iterable[str]) -> dict[str, str]:
    """A free TCP endpoint on the loopback interface for each name."""
    sockets = {name: socket.create_server(("127.0.0.1", 0)) for name in names}
    endpoints = {name: f"tcp/127.0.0.1:{s.getsockname()[1]}" for name, s in sockets.items()}
    for s in sockets.values():
        s.close()
    return endpoints


def launch(
    names: list[str],
    give: Callable[[str, dict[str, str], IO[bytes]], None],
    key_prefix: str,
    observe: Callable[[Watch], bool],
    beside: Iterable[str] = (),
    external: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, str]:
    """Run the processes `names` as children of this one until the run has ended; what those beside had to say.

    Args:
        names: the processes.
        give: writes what a process of this name is given, with everybody's endpoints, to its standard input.
        key_prefix: the key prefix.
        observe: called about five times a second; says whether to stop.
        beside: processes without which the run goes on.
        external: endpoints of those among `names` that somebody else starts; everybody connects to them.

    Raises:
        RunFailed: a service died or froze.
        ValueError: a service refused to start; the text says why.
    """
    beside = list(beside)
    everybody = [name for name in [*names, *beside] if name not in external]
    endpoints = {**external, **loopback_endpoints([*everybody, WATCHER])}
    children: dict[str, subprocess.Popen] = {}
    errors: dict[str, Any] = {name: tempfile.TemporaryFile() for name in everybody}  # noqa: SIM115 (closed below)
    try:
        for name in everybody:
            # -P: nothing is imported from the working directory
            children[name] = subprocess.Popen(
                [sys.executable, "-P", "-m", PARTICIPANT, name],
                stdin=subprocess.PIPE,
                stdout=errors[name],
                stderr=errors[name],
                start_new_session=True,
            )
        for name in everybody:
            stream = children[name].stdin
            assert stream is not None
            with suppress(BrokenPipeError):  # it has ended already, and has said why
                give(name, endpoints, stream)
        listen, connect = mesh(WATCHER, endpoints)
        with ZenohBus(listen, connect) as bus:
            try:
                _follow(Watch(bus, key_prefix), children, set(names), set(external), observe, errors)
            finally:
                early = {name for name in beside if children[name].poll() is not None}
                _ask_to_end(children)  # before this session closes, which takes a while
        _end(children)
        return {name: _farewell(children[name].returncode if name in early else 0, errors[name]) for name in beside}
    finally:
        _end(children)
        for file in errors.values():
            file.close()


def _follow(
    watch: Watch,
    everybody: dict,
    needed: set[str],
    external: set[str],
    observe: Callable[[Watch], bool],
    errors: dict,
) -> None:
    ended_at = None
    children = {name: child for name, child in everybody.items() if name in needed}
    while any(child.poll() is None for child in children.values()):
        watch.poll(0.2)
        for name, child in everybody.items():
            if child.poll() == REFUSED:
                raise ValueError(f"{name}{_last_words(errors[name])}")
        for name, child in children.items():
            code = child.poll()
            if code is None or (code != 0 and (watch.diverged or _diverges(watch))):
                continue
            if code != 0 or (not watch.ended and ended_at is None and not _grace(watch)):
                raise RunFailed(f"{name} ended unexpectedly ({_reason(code)}) {_at(watch)}{_last_words(errors[name])}")
        if not watch.ended and (lost := sorted(watch.gone & external)) and not _grace(watch):
            raise RunFailed(f"{', '.join(lost)}: gone {_at(watch)}")
        if needed <= watch.present and (culprit := watch.frozen(needed)):
            if not _let_go(everybody, needed):
                raise RunFailed(culprit)
            watch.last_news = time.monotonic()
        if not watch.present >= needed:
            watch.last_news = time.monotonic()
        if observe(watch):
            return
        if watch.ended:
            ended_at = ended_at or time.monotonic()
            if time.monotonic() - ended_at > STALL:
                _let_go(everybody, needed)  # a session cannot close while a frozen one has not heard all
            if time.monotonic() - ended_at > FAREWELL:
                left = ", ".join(name for name, child in children.items() if child.poll() is None)
                raise RunFailed(f"{left}: did not end within {FAREWELL:g} s of the last tick")
    observe(watch)


def _let_go(everybody: dict, needed: set[str]) -> bool:
    """Kill those beside the run, one of whom may be frozen and hold it up; says whether there was any."""
    beside = [child for name, child in everybody.items() if name not in needed and child.poll() is None]
    for child in beside:
        child.kill()
        child.wait()
    return bool(beside)


def _grace(watch: Watch) -> bool:
    """Whether the news of the end arrives now, just after a process that knew of it has ended."""
    watch.poll(0.5)
    return watch.ended


def _diverges(watch: Watch) -> bool:
    """Whether the news arrives now that a state is no longer sound."""
    watch.poll(0.5)
    return watch.diverged


def _at(watch: Watch) -> str:
    return f"at t = {watch.time_ns * 1e-9:.3f} s"


def _reason(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _last_words(file: "tempfile._TemporaryFileWrapper") -> str:  # type: ignore[name-defined]
    file.seek(0)
    lines = file.read().decode(errors="replace").strip().splitlines()
    return f": {lines[-1].removeprefix('lapwing: ')}" if lines else ""


def _farewell(code: int, file: Any) -> str:
    if code:
        return f"ended before the flight ({_reason(code)}){_last_words(file)}"
    file.seek(0)
    return file.read().decode(errors="replace").strip()


def _ask_to_end(children: dict[str, subprocess.Popen]) -> None:
    for child in children.values():
        if child.poll() is None:
            child.terminate()


def _end(children: dict[str, subprocess.Popen]) -> None:
    """End what still runs: first asked, then forced."""
    _ask_to_end(children)
    deadline = time.monotonic() + GRACE
    for child in children.values():
        try:
            child.wait(timeout=max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
        if child.stdin:
            child.stdin.close()
