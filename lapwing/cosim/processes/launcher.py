"""Launcher: starts the processes of a run, supervises them, and ends them all together."""

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, suppress
from threading import Thread
from typing import IO

from lapwing.cosim.access.private_sockets import private_endpoints
from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.processes.child_process import Child, start, terminate_unused
from lapwing.cosim.processes.patience import Patience
from lapwing.cosim.processes.run_monitor import LONGEST, MONITOR, RunMonitor
from lapwing.cosim.processes.supervisor import SHUTDOWN_TIMEOUT, RunState, RunSupervisor, is_stopped_by_signal, reason
from lapwing.cosim.run_errors import END_SIGNAL, RunFailed
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import ALIVE_KEY
from lapwing.cosim.transport.session_settings import CHILD_LINKS, mesh

TERM_TIMEOUT = 4.0  # [s] from the request to end to SIGKILL; more than the watchdog of a service takes
HUNG = 128 + END_SIGNAL  # exit code by the watchdog of a service, whose last line names the block
BRIEF = 0.005  # [s] between two checks whether all processes have exited


def launch(
    required: list[str],
    send_spec: Callable[[str, dict[str, str], IO[bytes]], None],
    publisher_ids: PublisherIds,
    observe: Callable[[RunMonitor], bool],
    optional: list[str],
    external: Mapping[str, str],
    early: dict[str, Child],
    services: Iterable[str],
) -> dict[str, str]:
    """Run the processes as children until the run ends. Return the final output of each optional process.

    Args:
        required: names of the processes that the run needs.
        send_spec: writes the specification of the named process, with all endpoints, to its standard input.
        publisher_ids: publisher GIDs of the run.
        observe: called about five times a second; the run is ended when it returns True.
        optional: names of processes that may end without ending the run.
        external: endpoints of the required participants that are started elsewhere; all others connect to them.
        early: processes that run already (`start_early`); those that the run does not need are ended.
        services: services that publish log packets.

    Raises:
        RunFailed: a service died or stalled, the run ended early, or a process did not end by itself.
        ValueError: a service rejected its configuration; the text says why.
    """
    # optional ones first: a ground station may be waiting for its link
    own = [name for name in [*optional, *required] if name not in external]
    children: dict[str, Child] = {}
    exited: dict[str, int] = {}  # exit codes of optional processes that ended before the run
    error: RunFailed | None = None
    with private_endpoints([MONITOR, *own]) as sockets, ExitStack() as stack:
        stack.callback(_close, children)
        endpoints = {**external, **sockets}

        def start_processes(names: list[str]) -> None:
            for name in names:
                children[name] = early.pop(name) if name in early else start(name)
            for name in names:  # in threads: a pipe holds less than a specification, and a stopped child reads none
                Thread(target=send, args=(name,), daemon=True).start()

        def send(name: str) -> None:
            stream = children[name].process.stdin
            assert stream is not None
            with suppress(BrokenPipeError):  # it has exited; its output has the reason
                send_spec(name, endpoints, stream)

        listen, connect = mesh(MONITOR, endpoints)
        links = {} if external else CHILD_LINKS
        with ZenohBus(listen, connect, "peer", publisher_ids.gid(MONITOR), links, awaits=False) as bus:
            try:
                monitor = RunMonitor(bus, publisher_ids, [*required, *optional, *external], services=services)
                # all other processes wait for it
                bus.declare_liveliness(f"{publisher_ids.key_prefix}/{ALIVE_KEY}/{MONITOR}")
                ready = [name for name in own if name in early]
                start_processes(ready)
                start_processes([name for name in own if name not in ready])
                terminate_unused(early)
                supervisor = RunSupervisor(monitor, children, required, external)
                supervisor.supervise(observe)
                if supervisor.state is RunState.ENDED:  # their reports follow
                    _wait([children[name] for name in optional], SHUTDOWN_TIMEOUT)
            except RunFailed as failure:
                error = failure
            finally:
                for name in optional:
                    if name in children and (code := children[name].process.poll()) is not None:
                        exited[name] = code
                _request_end(children.values())  # before this session closes, which takes a while
        hung = {name: text for name, text in _end(children).items() if name in required}
        named = [f"{name}: {text}" for name, text in hung.items()]
        if monitor.start is None and monitor.compiling:  # not to end while it compiles is no fault of a service
            named = [f"compiling kernels of {', '.join(hung)}"] if hung and error is None else []
        if named:
            raise RunFailed("; ".join([*([str(error)] if error else []), *named]))
        if error:
            raise error
        return {name: _final_output(children[name], exited.get(name, 0)) for name in optional}


def _close(children: Mapping[str, Child]) -> None:
    _end(children)
    for child in children.values():
        child.output.close()


def _final_output(child: Child, code: int) -> str:
    return f"ended before the flight ({reason(code)}){child.last_line()}" if code else child.text()


def _request_end(children: Iterable[Child]) -> None:
    for child in children:
        if child.process.poll() is None:
            child.process.send_signal(END_SIGNAL)


def _wait(children: list[Child], seconds: float) -> None:
    """Wait until all processes have exited, at most `seconds` plus the time that they waited for a CPU."""
    patience = Patience(seconds, *(child.process.pid for child in children), longest=LONGEST)
    while any(child.process.poll() is None for child in children) and not patience.over:
        time.sleep(BRIEF)


def _end(children: Mapping[str, Child]) -> dict[str, str]:
    """End all processes that still run: request first, then kill. Return by name what did not end by itself."""
    stopped = [name for name, child in children.items() if is_stopped_by_signal(child.process)]
    _request_end(children.values())
    _wait([*children.values()], TERM_TIMEOUT)
    hung: dict[str, str] = {}
    for name, child in children.items():
        if killed := child.process.poll() is None:
            child.process.kill()
            child.process.wait()
        if child.process.poll() == HUNG:  # also if it exited just before it was killed
            hung[name] = child.last_line().rpartition("; ")[2]
        elif killed and name not in stopped:
            hung[name] = f"did not end within {TERM_TIMEOUT:g} s, killed"
        if child.process.stdin:
            with suppress(BrokenPipeError):  # killed before it had read its specification
                child.process.stdin.close()
    return hung
