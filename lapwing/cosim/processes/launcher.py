"""Starts the services of a scene as processes, watches them, and ends them all together."""

import os
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, suppress
from types import MappingProxyType
from typing import IO

from lapwing.cosim.access.private_sockets import private_endpoints
from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.processes.child_process import Child, dismiss, start
from lapwing.cosim.processes.cpu_starvation import Starvation, waited
from lapwing.cosim.processes.forked_process import Forked
from lapwing.cosim.processes.run_monitor import LONGEST, MONITOR, STALL, RunMonitor
from lapwing.cosim.run_errors import RunFailed
from lapwing.cosim.transport.bus import ZenohBus, mesh
from lapwing.cosim.transport.bus_keys import ALIVE_KEY

TERM_TIMEOUT = 1.5  # [s] a process gets to end after SIGTERM
FINAL_POLL_TIME = 0.05  # [s] for what the processes said at their end
SHUTDOWN_TIMEOUT = 10.0  # [s] the processes get to end by themselves after the last tick, or the last news after it
BRIEF = 0.005  # [s] between two looks at whether all have ended
REFUSED = 2  # exit code of a service whose user can mend what is wrong


def launch(
    names: list[str],
    give: Callable[[str, dict[str, str], IO[bytes]], None],
    participants: PublisherIds,
    observe: Callable[[RunMonitor], bool],
    beside: Iterable[str] = (),
    external: Mapping[str, str] = MappingProxyType({}),
    started: dict[str, Child] | None = None,
    services: Iterable[str] = (),
) -> dict[str, str]:
    """Run the processes `names` as children of this one until the run has ended; what those beside had to say.

    Args:
        names: the processes.
        give: writes what a process of this name is given, with everybody's endpoints, to its standard input.
        participants: of the run.
        observe: called about five times a second; says whether to stop.
        beside: processes without which the run goes on.
        external: endpoints of those among `names` that somebody else starts; everybody connects to them.
        started: processes that are there already (`started_early`); those that are not needed are ended.
        services: those that hand over messages.

    Raises:
        RunFailed: a service died or froze, or the run ended before its time.
        ValueError: a service refused to start; the text says why.
    """
    beside = list(beside)
    everybody = [name for name in [*beside, *names] if name not in external]  # a ground station waits for its link
    children: dict[str, subprocess.Popen | Forked] = {}
    errors: dict[str, IO[bytes]] = {}
    with private_endpoints([MONITOR, *everybody]) as own, ExitStack() as stack:
        stack.callback(_close, children, errors)
        endpoints = {**external, **own}

        def begin(some: list[str]) -> None:
            for name in some:
                children[name], errors[name] = started.pop(name) if started and name in started else start(name)
            for name in some:
                stream = children[name].stdin
                assert stream is not None
                with suppress(BrokenPipeError):  # it has ended already, and has said why
                    give(name, endpoints, stream)

        listen, connect = mesh(MONITOR, endpoints)
        with ZenohBus(listen, connect, mark=participants.mark(MONITOR), awaits=False) as bus:
            try:
                watch = RunMonitor(bus, participants, [*names, *beside, *external], services=services)
                bus.declare_alive(f"{participants.key_prefix}/{ALIVE_KEY}/{MONITOR}")  # they wait for it
                ready = [name for name in everybody if name in (started or ())]
                begin(ready)
                begin([name for name in everybody if name not in ready])
                dismiss(started or {})
                _follow(watch, children, set(names), set(external), observe, errors)
                _await({name: children[name] for name in beside if name in watch.confirmed}, SHUTDOWN_TIMEOUT)
            finally:
                early = {
                    name: code for name in beside if name in children and (code := children[name].poll()) is not None
                }
                _ask_to_end(children)  # before this session closes, which takes a while
        _end(children)
        return {name: _farewell(early.get(name, 0), errors[name]) for name in beside}


def _close(children: dict[str, subprocess.Popen | Forked], errors: dict[str, IO[bytes]]) -> None:
    _end(children)
    for file in errors.values():
        file.close()


def _follow(
    watch: RunMonitor,
    everybody: dict,
    needed: set[str],
    external: set[str],
    observe: Callable[[RunMonitor], bool],
    errors: dict[str, IO[bytes]],
) -> None:
    ended_at = None
    stopped: dict[str, float] = {}  # since when
    starvation = Starvation()
    while any(everybody[name].poll() is None for name in needed - external):
        children = {name: child for name, child in everybody.items() if name in needed}
        watch.poll(FINAL_POLL_TIME if watch.ended else 0.2)
        for name, child in everybody.items():
            if child.poll() == REFUSED:
                raise ValueError(f"{name}{_last_words(errors[name])}")
            if name not in needed | watch.present and child.poll():
                raise ValueError(f"{name}: cannot start ({_reason(child.poll())}){_last_words(errors[name])}")
        for name, child in children.items():
            code = child.poll()
            if code is None or (code != 0 and (watch.diverged or _diverges(watch))):
                continue
            if code != 0 or (not watch.ended and ended_at is None and not _grace(watch)):
                raise RunFailed(f"{name} ended unexpectedly ({_reason(code)}) {_at(watch)}{_last_words(errors[name])}")
        if not watch.ended and (lost := sorted(watch.gone & external)) and not _grace(watch):
            raise RunFailed(f"{', '.join(lost)}: gone {_at(watch)}")
        _note_stopped(children, stopped)
        starvation.look({name: child.pid for name, child in children.items()}, time.monotonic() - watch.last_news)
        awaited = needed if watch.began else needed | set(everybody)
        culprit = watch.frozen(needed, starvation.of) if awaited <= watch.present else None
        if stopped and (culprit or time.monotonic() - min(stopped.values()) > STALL):
            raise RunFailed(f"{', '.join(sorted(stopped))}: stopped for {STALL:g} s, {_at(watch)}")
        if culprit:
            if not _let_go(everybody, needed):
                raise RunFailed(culprit)
            watch.last_news = time.monotonic()
        if not watch.present >= awaited:
            watch.last_news, ended_at = time.monotonic(), None
        if observe(watch):
            return
        if watch.ended:
            ended_at = ended_at or time.monotonic()
            if time.monotonic() - ended_at > STALL:
                _let_go(everybody, needed)  # a session cannot close while a frozen one has not heard all
            silence = time.monotonic() - max(ended_at, watch.last_news)
            if silence > LONGEST or silence - starvation.of(children) > SHUTDOWN_TIMEOUT:
                if early := watch.broken_off():  # the first fault is told
                    raise RunFailed(early)
                left = [name for name, child in children.items() if child.poll() is None]
                silent = [name for name in left if name not in watch.confirmed] or left
                raise RunFailed(f"{', '.join(silent)}: did not end within {SHUTDOWN_TIMEOUT:g} s of the last news")
    watch.poll(FINAL_POLL_TIME)
    observe(watch)
    if early := watch.broken_off():
        raise RunFailed(early)


def _note_stopped(children: dict[str, subprocess.Popen | Forked], since: dict[str, float]) -> None:
    """Note in `since` who is stopped, and when it was first noticed; also where it has not yet joined."""
    for name, child in children.items():
        if child.returncode is None and _stopped(child):
            since.setdefault(name, time.monotonic())
        else:
            since.pop(name, None)


def _stopped(child: subprocess.Popen | Forked) -> bool:
    """Whether it is stopped; one that has just ended is not."""
    try:
        return os.waitid(os.P_PID, child.pid, os.WSTOPPED | os.WNOHANG | os.WNOWAIT) is not None
    except ChildProcessError:
        return False


def _let_go(everybody: dict, needed: set[str]) -> bool:
    """Kill those beside the run, one of whom may be frozen and hold it up; says whether there was any."""
    beside = [child for name, child in everybody.items() if name not in needed and child.poll() is None]
    for child in beside:
        child.kill()
        child.wait()
    return bool(beside)


def _grace(watch: RunMonitor) -> bool:
    """Whether the news of the end arrives now, just after a process that knew of it has ended."""
    watch.poll(0.5)
    return watch.ended


def _diverges(watch: RunMonitor) -> bool:
    """Whether the news arrives now that a state is no longer sound."""
    watch.poll(0.5)
    return watch.diverged


def _at(watch: RunMonitor) -> str:
    return f"at t = {watch.time_ns * 1e-9:.3f} s"


def _reason(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _last_words(file: IO[bytes]) -> str:
    file.seek(0)
    lines = file.read().decode(errors="replace").strip().splitlines()
    return f": {lines[-1].removeprefix('lapwing: ')}" if lines else ""


def _farewell(code: int, file: IO[bytes]) -> str:
    if code:
        return f"ended before the flight ({_reason(code)}){_last_words(file)}"
    file.seek(0)
    return file.read().decode(errors="replace").strip()


def _ask_to_end(children: dict[str, subprocess.Popen | Forked]) -> None:
    for child in children.values():
        if child.poll() is None:
            child.terminate()


def _await(children: Mapping[str, subprocess.Popen | Forked], seconds: float) -> None:
    """Wait until all have ended, `seconds` at most, in which the time that they wait for a processor does not count."""
    began = time.monotonic()
    before = {name: waited(child.pid) for name, child in children.items()}
    while left := [name for name, child in children.items() if child.poll() is None]:
        passed = time.monotonic() - began
        starved = sum(max(0.0, waited(children[name].pid) - before[name]) for name in left)
        if passed > LONGEST or passed - starved > seconds:
            return
        time.sleep(BRIEF)


def _end(children: dict[str, subprocess.Popen | Forked]) -> None:
    """End what still runs: first asked, then forced."""
    _ask_to_end(children)
    _await(children, TERM_TIMEOUT)
    for child in children.values():
        if child.poll() is None:
            child.kill()
            child.wait()
        if child.stdin:
            child.stdin.close()
