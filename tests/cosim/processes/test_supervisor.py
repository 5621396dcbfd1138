"""State machine of a run, with simulated processes, messages and time."""

import io
import os
import re
from collections import Counter
from types import SimpleNamespace

import pytest

from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.processes.child_process import Child
from lapwing.cosim.processes.run_monitor import LONGEST, STALL, RunMonitor
from lapwing.cosim.processes.supervisor import SHUTDOWN_TIMEOUT, RunState, RunSupervisor
from lapwing.cosim.run_errors import ExitCode, RunFailed

NAMES = ["plant", "sensors", "recorder"]


class Process:
    """A process with a settable exit code."""

    pid = 1 << 30  # no process has this id

    def __init__(self):
        self.returncode, self.stopped, self.killed = None, False, False

    def poll(self):
        return self.returncode

    def wait(self):
        return self.returncode

    def kill(self):
        self.returncode, self.killed = -9, True


class Run:
    """A supervised run of three required processes and an optional one."""

    def __init__(self, monkeypatch, external=()):
        bus = SimpleNamespace(receive=lambda senders: None, watch_liveliness=lambda key, seen: None)
        self.now = 100.0
        monkeypatch.setattr("lapwing.cosim.processes.run_monitor.time.monotonic", lambda: self.now)
        # on a busy machine, the starvation of this process would extend the fake times
        monkeypatch.setattr("lapwing.cosim.processes.patience._scheduled", lambda *_: Counter())
        monkeypatch.setattr("lapwing.cosim.processes.patience.machine_stall_time", lambda: 0.0)
        self.monitor = RunMonitor(bus, PublisherIds("test"), NAMES)
        self.monitor.poll = self.pass_time
        own = [name for name in [*NAMES, "mavlink"] if name not in external]
        self.processes = {name: Process() for name in own}
        children = {name: Child(process, io.BytesIO(b"lapwing: cause\n")) for name, process in self.processes.items()}
        self.children = children
        clock, stopped = (lambda: self.now), (lambda process: process.stopped)
        self.supervisor = RunSupervisor(self.monitor, children, NAMES, external, clock, stopped)

    def pass_time(self, seconds):
        self.now += seconds

    def times(self, share):
        """Return the times of a process whose only thread has waited, or run, for a share of the time."""
        return Counter({0: round(1e9 * share * self.now)})

    def start(self):
        self.update()
        self.monitor.present = {*NAMES, "mavlink"}
        self.update()
        assert self.state is RunState.RUNNING
        return self

    def exit(self, *names, code=ExitCode.COMPLETED):
        for name in names:
            self.processes[name].returncode = code

    def update(self, seconds=0.2):
        self.pass_time(seconds)
        self.supervisor.update()

    def update_for(self, seconds):
        for _ in range(round(seconds / 0.2)):
            self.update()

    @property
    def state(self):
        return self.supervisor.state


@pytest.fixture
def run(monkeypatch):
    return Run(monkeypatch)


def fails(message):
    return pytest.raises(RunFailed, match=f"^{re.escape(message)}")


def test_states_follow_start_end_and_exit(run):
    assert run.state is RunState.STARTING
    run.update_for(60.0)
    assert run.state is RunState.STARTING
    run.start()
    run.monitor.ended, run.monitor.outcome = True, ""
    run.update()
    assert run.state is RunState.ENDING
    run.exit("plant", "sensors")
    run.update()
    assert run.state is RunState.ENDING
    run.exit("recorder")
    run.supervisor.supervise(lambda monitor: False)
    assert run.state is RunState.ENDED


def test_supervision_ends_on_request_of_observer(run):
    run.start().supervisor.supervise(lambda monitor: run.now > 101.0)
    assert run.state is RunState.RUNNING


@pytest.mark.parametrize(
    ("code", "reason"), [(-9, "signal 9"), (ExitCode.TERMINATED, "signal 15"), (ExitCode.FAILED, "exit code 1")]
)
def test_unexpected_exit_is_named_with_reason(run, code, reason):
    run.start().exit("sensors", code=code)
    run.exit("plant", code=ExitCode.CUT_SHORT)
    with fails(f"sensors ended unexpectedly ({reason}) at t = 0.000 s: cause"):
        run.update()


def test_fault_of_service_is_named_once(run):
    run.children["sensors"].output.write(b"lapwing: sensors: no terrain\n")
    run.start().exit("sensors", code=ExitCode.FAILED)
    with fails("sensors ended unexpectedly (exit code 1) at t = 0.000 s: no terrain"):
        run.update()


def test_rejected_configuration_of_any_process_ends_run(run):
    run.start().exit("mavlink", code=ExitCode.REJECTED)
    with pytest.raises(ValueError, match="mavlink: cause"):
        run.update()


def test_failed_start_of_optional_process_ends_run(run):
    run.update()
    run.exit("mavlink", code=1)
    with pytest.raises(ValueError, match=r"^mavlink: cannot start \(exit code 1\): cause$"):
        run.update()


def test_exit_of_optional_process_does_not_end_run(run):
    run.start().exit("mavlink", code=-9)
    run.update_for(1.0)
    assert run.state is RunState.RUNNING


def test_completed_processes_need_no_message_of_end(run):
    """The messages are lost if the launcher was stopped while the run ended."""
    run.start().pass_time(60.0)
    run.exit(*NAMES)
    run.supervisor.supervise(lambda monitor: False)
    assert run.state is RunState.ENDED


def test_late_messages_after_pause_of_launcher_are_no_stall(run):
    run.start().exit("mavlink")
    run.update(60.0)
    run.update_for(STALL - 0.4)
    with fails("plant, recorder, sensors: no answer for 2.5 s"):
        run.update_for(1.0)


def test_early_exit_of_service_is_reported_as_unexpected(run):
    run.start().exit("sensors")
    run.update()
    assert run.state is RunState.ENDING
    with fails("sensors ended unexpectedly (exit code 0)"):
        run.update_for(SHUTDOWN_TIMEOUT + 1.0)


def test_stalled_optional_process_is_killed_first(run):
    run.start().update_for(STALL + 0.4)
    assert run.processes["mavlink"].killed
    with fails("plant, recorder, sensors: no answer for 2.5 s, at t = 0.000 s"):
        run.update_for(STALL + 0.4)


def test_optional_process_may_finish_while_there_are_news(run):
    run.start()
    run.monitor.ended, run.monitor.outcome = True, ""
    for _ in range(10):
        run.update_for(2.0)
        run.monitor.last_news = run.now  # the recorder writes to a slow disk
    assert not run.processes["mavlink"].killed
    run.update_for(STALL + 0.4)
    assert run.processes["mavlink"].killed
    assert run.state is RunState.ENDING


@pytest.mark.parametrize("measure", ["starved_times", "cpu_times"])
def test_busy_optional_process_is_killed_after_a_minute(monkeypatch, measure):
    run = Run(monkeypatch)
    run.processes["mavlink"].pid = 1 << 29
    monkeypatch.setattr(f"lapwing.cosim.processes.patience.{measure}", lambda pid: run.times(pid == 1 << 29))
    run.start()
    run.monitor.ended, run.monitor.outcome = True, ""
    run.update_for(LONGEST - 1.0)
    assert not run.processes["mavlink"].killed
    run.update_for(2.0)
    assert run.processes["mavlink"].killed
    run.update_for(2.0)
    assert run.state is RunState.ENDING


def test_starved_launcher_reports_no_stall(monkeypatch):
    run = Run(monkeypatch)
    own = os.getpid()
    monkeypatch.setattr("lapwing.cosim.processes.patience.starved_times", lambda pid: run.times(0.9 * (pid == own)))
    run.start().update_for(15.0)
    assert run.state is RunState.RUNNING
    assert not run.processes["mavlink"].killed


@pytest.mark.parametrize("joined", [True, False])
def test_stopped_process_is_named_in_every_state(run, joined):
    if joined:
        run.start()
    run.processes["sensors"].stopped = True
    with fails("sensors: stopped for 2.5 s, at t = 0.000 s"):
        run.update_for(3.0)


def test_process_that_does_not_exit_is_named(run):
    run.start()
    run.monitor.ended, run.monitor.outcome = True, ""
    run.exit("plant", "sensors")
    run.update_for(SHUTDOWN_TIMEOUT)
    with fails("recorder: did not end within 10 s of the last message"):
        run.update_for(1.0)


def test_process_that_does_not_exit_tells_its_reason(run):
    run.start()
    run.monitor.ended, run.monitor.outcome = True, ""
    run.monitor.waiting["recorder"] = "the messages of plant from tick 7 on"
    run.exit("plant", "sensors")
    end = "recorder: did not end within 10 s of the last message"
    with fails(f"{end}; recorder waits for the messages of plant from tick 7 on"):
        run.update_for(SHUTDOWN_TIMEOUT + 1.0)


def test_first_cause_of_early_end_is_reported(run):
    run.start()
    run.monitor.ended, run.monitor.outcome = True, "sensors was ended by SIGTERM"
    run.exit(*NAMES)
    with fails("the run ended early at t = 0.000 s: sensors was ended by SIGTERM"):
        run.supervisor.supervise(lambda monitor: False)


def test_cut_short_process_reports_its_cause(run):
    run.start().exit(*NAMES)
    run.exit("plant", code=ExitCode.CUT_SHORT)
    with fails("the run ended early at t = 0.000 s: cause"):
        run.supervisor.supervise(lambda monitor: False)


def test_divergence_is_orderly_end(run):
    run.start().exit("plant", code=ExitCode.DIVERGED)
    run.exit("sensors", code=ExitCode.FAILED)
    run.update()
    run.exit("recorder")
    run.supervisor.supervise(lambda monitor: False)
    assert run.state is RunState.ENDED


def test_lost_external_service_is_named(monkeypatch):
    run = Run(monkeypatch, external=["sensors"]).start()
    run.monitor.left = {"sensors"}
    with fails("sensors: left the run at t = 0.000 s"):
        run.update()
