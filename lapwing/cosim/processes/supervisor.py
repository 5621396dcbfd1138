"""Supervision of the processes of a run: detection of its end and of the process that failed."""

import os
import signal
import time
from collections.abc import Callable, Iterable, Mapping
from enum import Enum

from lapwing.cosim.processes import child_process
from lapwing.cosim.processes.child_process import Child, ChildProcess
from lapwing.cosim.processes.patience import Starvation
from lapwing.cosim.processes.run_monitor import LONGEST, MONITOR, STALL, RunMonitor
from lapwing.cosim.run_errors import ExitCode, RunFailed

POLL = 0.2  # [s] between two updates in flight
FINAL_POLL_TIME = 0.05  # [s] between two updates at the end of a run
SHUTDOWN_TIMEOUT = 10.0  # [s] from the last message of a run to the exit of its processes
ORDERLY = (ExitCode.COMPLETED, ExitCode.CUT_SHORT, ExitCode.DIVERGED)  # exit codes of processes without fault


class RunState(Enum):
    """State of a run."""

    STARTING = "starting"  # a participant has not joined yet
    RUNNING = "running"  # all participants have joined
    ENDING = "ending"  # a service has published its last message, or a process has exited
    ENDED = "ended"  # no required process is left


class RunSupervisor:
    """State machine over the child processes of a run and its messages on the bus.

    Attributes:
        state: state of the run after the last `update`.
    """

    def __init__(
        self,
        monitor: RunMonitor,
        children: Mapping[str, Child],
        required: Iterable[str],
        external: Iterable[str],
        clock: Callable[[], float] = time.monotonic,
        is_stopped: Callable[[ChildProcess], bool] | None = None,
    ):
        """Supervise a run.

        Args:
            monitor: observes the bus.
            children: processes by name.
            required: names of the participants without which the run fails.
            external: names of those among them that are not children.
            clock: time [s].
            is_stopped: returns True if a child is stopped by a signal.
        """
        self.state = RunState.STARTING
        self._monitor, self._children, self._clock = monitor, children, clock
        self._required, self._external = set(required), set(external)
        self._own = [name for name in children if name in self._required]
        self._optional = [name for name in children if name not in self._required]
        self._is_stopped = is_stopped or is_stopped_by_signal
        self._starvation = Starvation()
        self._stopped_since: dict[str, float] = {}
        self._ending_since = 0.0
        self._updated = clock()
        self._killed_before = child_process.kills()

    def supervise(self, observe: Callable[[RunMonitor], bool]) -> None:
        """Update until the run has ended, or `observe` returns True.

        Raises:
            RunFailed: names the process at fault.
            ValueError: a process rejected its configuration.
        """
        while self.state is not RunState.ENDED:
            self._monitor.poll(FINAL_POLL_TIME if self.state is RunState.ENDING else POLL)
            self.update()
            if observe(self._monitor):
                return
        self._check_outcome()

    def update(self) -> None:
        """Check the processes and the messages that have arrived, and set `state`. See `supervise` for exceptions."""
        now = self._clock()
        if now - self._updated > STALL:  # this process was stopped or starved: its messages are late
            self._monitor.last_news = now
        self._updated = now
        codes = {name: child.process.poll() for name, child in self._children.items()}
        self._check_exit_codes(codes)
        self._change_state([name for name in self._own if codes[name] is None], now)
        if self.state is RunState.ENDED:
            return
        self._check_external()
        self._note_stopped(now)
        pids = {name: child.process.pid for name, child in self._children.items()} | {MONITOR: os.getpid()}
        self._starvation.look(pids, now - self._monitor.last_news)
        if self.state is RunState.STARTING:
            self._monitor.last_news = now
        elif self.state is RunState.RUNNING:
            self._check_progress(now)
        else:
            self._check_shutdown(now)
        if self._stopped_since and now - min(self._stopped_since.values()) > STALL:
            raise self._stop_error()

    def _check_exit_codes(self, codes: Mapping[str, int | None]) -> None:
        for name, code in codes.items():
            if code == ExitCode.REJECTED:
                raise ValueError(f"{name}{self._children[name].last_line()}")
            if code and name not in self._required | self._monitor.present:
                raise ValueError(f"{name}: cannot start ({reason(code)}){self._children[name].last_line()}")
        if self._monitor.diverged or ExitCode.DIVERGED in codes.values():
            return
        for name in self._own:
            code = codes[name]
            if code is not None and code not in ORDERLY:
                raise self._unexpected_end(name, code)

    def _change_state(self, alive: list[str], now: float) -> None:
        expected = self._required if self._monitor.start else self._required | self._children.keys()
        if self.state is RunState.STARTING and self._monitor.present >= expected:
            self.state = RunState.RUNNING
        ends = len(alive) < len(self._own) or (self.state is RunState.RUNNING and self._monitor.ended)
        if ends and self.state is not RunState.ENDING:
            self.state, self._ending_since = RunState.ENDING, now
        if not alive:
            self.state = RunState.ENDED

    def _check_external(self) -> None:
        lost = sorted(self._monitor.left & self._external)
        if not lost or self.state is RunState.ENDING:
            return
        self._monitor.poll(0.5)  # the end may arrive over another link
        if not self._monitor.ended:
            raise RunFailed(f"{', '.join(lost)}: left the run {self._at()}")

    def _note_stopped(self, now: float) -> None:
        for name in self._own:
            child = self._children[name].process
            if child.returncode is None and self._is_stopped(child):
                self._stopped_since.setdefault(name, now)
            else:
                self._stopped_since.pop(name, None)

    def _check_progress(self, now: float) -> None:
        message = self._monitor.stall_message(self._required, self._starved)
        if message and self._stopped_since:
            raise self._stop_error()
        if message and not self._kill_optional():
            raise RunFailed(message)
        if message:
            self._monitor.last_news = now

    def _check_shutdown(self, now: float) -> None:
        monitor = self._monitor
        silence = now - max(self._ending_since, monitor.last_news)
        if self._is_long(silence, STALL) and self._kill_optional():  # a stalled process confirms nothing
            monitor.last_news = now - STALL  # the other processes now have their time to leave
            return
        if not self._is_long(silence, SHUTDOWN_TIMEOUT):
            return
        for name in self._own:
            code = self._children[name].process.poll()
            if code is not None and not monitor.ended:
                raise self._unexpected_end(name, code)
        if message := monitor.abort_message():
            raise RunFailed(message)
        running = [name for name in self._own if self._children[name].process.poll() is None]
        silent = [name for name in running if name not in monitor.confirmed] or running
        text = f"{', '.join(silent)}: did not end within {SHUTDOWN_TIMEOUT:g} s of the last message"
        raise RunFailed("; ".join([text, *monitor.waits(silent)]))

    def _starved(self, names: Iterable[str]) -> float:
        """Return the time [s] that these processes, and this one, have waited for a processor since the last news."""
        return self._starvation.of({*names, MONITOR})

    def _is_long(self, silence: float, patience: float) -> bool:
        """Return True if a silence at the end of a run exceeds `patience` plus the time that processes waited for a
        processor, and that optional ones ran: they may have much data left to handle."""
        excused = self._starved(self._children) + self._starvation.run_time(self._optional)
        return silence > LONGEST or silence - excused > patience

    def _check_outcome(self) -> None:
        """Raise RunFailed if the run ended early. If all processes completed, no message about the end is needed."""
        codes = {name: self._children[name].process.poll() for name in self._own}
        if self._monitor.diverged or ExitCode.DIVERGED in codes.values():
            return
        for name, code in codes.items():
            if code == ExitCode.CUT_SHORT and not self._monitor.outcome:
                self._monitor.outcome = self._children[name].last_line().removeprefix(": ")
        if self._monitor.outcome:
            raise RunFailed(self._monitor.abort_message())

    def _kill_optional(self) -> bool:
        """Kill optional processes, one of which may be stalled and block the run; return True if there was one."""
        optional = [self._children[name].process for name in self._optional]
        running = [process for process in optional if process.poll() is None]
        for process in running:
            process.kill()
            process.wait()
        return bool(running)

    def _stop_error(self) -> RunFailed:
        return RunFailed(f"{', '.join(sorted(self._stopped_since))}: stopped for {STALL:g} s, {self._at()}")

    def _unexpected_end(self, name: str, code: int) -> RunFailed:
        output = self._children[name].last_line().replace(f": {name}: ", ": ", 1)  # its own messages name it, too
        killed = code == -signal.SIGKILL and child_process.kills() > self._killed_before
        memory = "; the system killed it for lack of memory" if killed else ""
        return RunFailed(f"{name} ended unexpectedly ({reason(code)}) {self._at()}{output}{memory}")

    def _at(self) -> str:
        return f"at t = {self._monitor.time_ns * 1e-9:.3f} s"


def reason(code: int) -> str:
    """Return an exit code as text."""
    number = -code if code < 0 else code - 128
    return f"signal {number}" if number > 0 else f"exit code {code}"


def is_stopped_by_signal(child: ChildProcess) -> bool:
    """Return True if a child is stopped, for example by SIGSTOP."""
    try:
        return os.waitid(os.P_PID, child.pid, os.WSTOPPED | os.WNOHANG | os.WNOWAIT) is not None
    except ChildProcessError:  # it has just exited
        return False
