"""Common parts of firmware adapters: volts, time-outs, playback of recorded commands."""

import json
import math
import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.cosim.log import LogReader
from lapwing.cosim.processes.patience import Patience
from lapwing.runs.resimulate import resimulate
from lapwing.runs.single_process_run import fly_single
from lapwing.services.betaflight import link as betaflight
from lapwing.services.common.firmware import hold
from lapwing.services.common.firmware.hold import FirmwareCommand, HeldState, Hold
from lapwing.services.common.firmware.link import FirmwareOutput, LinkReport
from lapwing.services.common.firmware.program import FirmwareError, Program
from lapwing.services.common.firmware.service import firmware_service
from lapwing.services.common.ports import BatteryReading, Setpoint
from lapwing.services.scene_resolver import load, resolve
from tests.participants import running

QUAD = ["run.duration=1.0", "run.real_time_factor=1000.0"]


def test_output_is_fraction_of_battery_voltage():
    p, none = Hold(14.8, (0.0,) * 4), (0.0,) * 4
    command = InputSample(True, FirmwareCommand((0.0, 0.25, 0.5, 1.0), True, False))
    before, charged = InputSample(False, BatteryReading()), InputSample(True, BatteryReading(1.0, 16.0, 0.0))
    state, (motors, status), _ = hold.step.py_func(p, HeldState(14.8), 0, (command, before))
    assert motors.motor_voltage == pytest.approx((0.0, 3.7, 7.4, 14.8))
    state, (motors, status), _ = hold.step.py_func(p, state, 1, (command, charged))
    assert motors.motor_voltage == pytest.approx((0.0, 4.0, 8.0, 16.0))
    state, (motors, status), _ = hold.step.py_func(p, state, 2, (command, before))
    assert motors.motor_voltage == pytest.approx((0.0, 4.0, 8.0, 16.0))
    assert (motors.armed, status.armed, status.landed, motors.thrust) == (True, True, False, none)


@pytest.mark.parametrize("follows", [True, False])
def test_reference_velocity_is_nan_without_followed_trajectory(follows):
    command = InputSample(True, FirmwareCommand((0.0,) * 4, True, follows=follows))
    reference = Setpoint((1.0, 2.0, 3.0), (0.0, 0.0, -0.5), phase=2)
    inputs = command, InputSample(False, BatteryReading()), InputSample(True, reference)
    setpoint = hold.step.py_func(Hold(14.8, (0.0,) * 4), HeldState(14.8), 0, inputs)[1][2]
    expected = reference.velocity_world if follows else (math.nan,) * 3
    assert setpoint.velocity_world == pytest.approx(expected, nan_ok=True)
    assert setpoint._replace(velocity_world=reference.velocity_world) == reference


def test_timeout_counts_from_restart():
    now = [0.0]
    patience = Patience(1.0, clock=lambda: now[0])
    now[0] = 0.9
    assert not patience.over
    patience.restart()
    now[0] = 1.8
    assert not patience.over
    now[0] = 8.0
    assert patience.over


class TakeoffLink:
    """Link whose firmware takes off at 0.2 s: rotors in the firmware's order get 0.6."""

    opened = closed = 0
    output, unrepeatable = "", "scripted"  # resimulated by its recorded commands

    def __init__(self, config):
        self._config, self.report = config, LinkReport("betaflight", "scripted")

    def open(self, waits):
        waits("nothing")
        type(self).opened += 1

    def step(self, tick, read):
        on = tick * self._config.interval > 0.2
        assert len(read("truth").rotor_speed) == 4
        return FirmwareOutput((0.6,) * 4 if on else (0.0,) * 4, on, not on, False, "test" if on else "ground")

    def cpu(self):
        return 1.0 + 0.5 * self.report.steps

    def close(self):
        type(self).closed += 1


class Counted(TakeoffLink):
    opened = closed = 0


class NonFiniteLink(TakeoffLink):
    def step(self, tick, read):
        return FirmwareOutput((float("nan"),) * 4, True)


def with_link(monkeypatch, link):
    monkeypatch.setattr(betaflight, "create", partial(firmware_service, name="betaflight", link=link))


def test_recorded_commands_fly_again_to_recorded_digest(tmp_path, monkeypatch):
    with_link(monkeypatch, Counted)
    log = tmp_path / "flight.mcap"
    fly_single(resolve(load("betaflight_quad", QUAD)), log)
    assert (Counted.opened, Counted.closed) == (1, 1)
    with LogReader(log) as read:
        assert read.metadata["firmware"].startswith("betaflight scripted: 501 steps, skew 0 ms")
        assert re.search(r"CPU [\d.]+ s of Lapwing and 250 s of the firmware", read.metadata["firmware"])
        recorded_digest = read.digest()
    assert resimulate(log) == (recorded_digest, recorded_digest)
    assert Counted.opened == 1


@pytest.mark.long
@pytest.mark.parametrize(("accuracy", "code"), [(1e-4, 0), (1e-12, 1)])
def test_accuracy_of_recorded_commands_is_measured(tmp_path, monkeypatch, accuracy, code):
    with_link(monkeypatch, TakeoffLink)
    log = tmp_path / "flight.mcap"
    fly_single(resolve(load("betaflight_quad", QUAD)), log)
    result = lapwing_check(tmp_path, log, "--json", "a.json", "--set", f"solver.accuracy={accuracy}")
    assert result.returncode == code, result.stdout + result.stderr
    assert f"accuracy of the solver {'missed' if code else 'met'}: error " in result.stdout
    assert f"required {accuracy:g}" in result.stdout
    assert "against steps of 0.125 ms" in result.stdout
    errors = {q["name"]: q["error"] for q in json.loads((tmp_path / "a.json").read_text())["quantities"]}
    assert 1e-12 < max(errors.values()) < 1e-6
    assert {"position", "attitude", "velocity", "body rates", "rotor speed"} <= set(errors)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--set", "solver.step=0.001"), "--set: the solver of a log is the recorded one; only solver.accuracy can"),
        (("--set", "solver.accuracy=-1"), "--set solver.accuracy: expected a number above 0, got -1"),
        ((), "solver.accuracy: missing; set the error to compare with"),
    ],
)
def test_check_of_log_rejects_invalid_request(tmp_path, monkeypatch, options, message):
    with_link(monkeypatch, TakeoffLink)
    log = tmp_path / "flight.mcap"
    fly_single(resolve(load("betaflight_quad", ["run.duration=0.01", "run.real_time_factor=1000.0"])), log)
    result = lapwing_check(tmp_path, log, *options)
    assert (result.returncode, message in result.stderr) == (2, True), result.stderr
    assert "Traceback" not in result.stderr


def test_check_of_firmware_scene_names_log(tmp_path):
    options = ("--set", "solver.accuracy=1e-4", "--set", "solver.step=0.001")
    result = lapwing_check(tmp_path, "betaflight_quad", *options)
    assert result.returncode == 2
    assert "betaflight flies it; record a flight with lapwing run, and check its log" in result.stderr


def lapwing_check(folder, scene, *options):
    command = [sys.executable, "-m", "lapwing", "check", str(scene), "--accuracy", *options]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)


def test_firmware_vehicle_leaves_ground(monkeypatch, tmp_path):
    from lapwing.api.flight import Flight

    with_link(monkeypatch, TakeoffLink)
    log = tmp_path / "flight.mcap"
    fly_single(resolve(load("betaflight_quad", QUAD)), log)
    flight = Flight.read(log)
    assert flight.truth.position[-1, 2] > 1.0
    assert flight.status.mode[-1] == "test"


def test_non_finite_outputs_end_run(monkeypatch, tmp_path):
    with_link(monkeypatch, NonFiniteLink)
    with pytest.raises(FirmwareError, match=r"betaflight: invalid motor outputs .* at t = 0.000 s"):
        fly_single(resolve(load("betaflight_quad", QUAD)), tmp_path / "flight.mcap")


def test_keys_of_firmware_are_rejected_without_one():
    from lapwing.cosim.scene import SceneError

    with pytest.raises(SceneError, match=r"autopilot.command.*is not used"):
        load("hover", ['autopilot.command=["x"]'])


def test_mavlink_is_rejected_with_reason(tmp_path):
    command = [sys.executable, "-m", "lapwing", "run", "betaflight_quad", "--mavlink", "udpout:127.0.0.1:14550"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=600, check=False)
    assert done.returncode == 2
    assert "--mavlink: betaflight flies the vehicle" in done.stderr


def config_of(command):
    return resolve(load("betaflight_quad", QUAD)).services["betaflight"].parameters._replace(command=tuple(command))


def test_temporary_folder_of_killed_run_is_removed(tmp_path):
    """A worker of a campaign that is stopped ends without any cleaning; its firmware writes until the end."""
    script = """
import os
from lapwing.services.common.firmware.program import Program
from tests.services.firmware_links import firmware_setup
loop = "while true; do echo x > file; done"
print(Program(firmware_setup("px4", None, 0, command=("sh", "-c", loop))).directory, flush=True)
os._exit(1)
"""
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=False)
    folder, patience = Path(done.stdout.strip()), Patience(60.0)
    assert folder.parent == tmp_path, done.stderr
    while folder.exists():
        assert not patience.over


def test_program_and_its_children_end():
    script = "import subprocess,sys,time; p=subprocess.Popen(['sleep','60']); print(p.pid, flush=True); time.sleep(60)"
    program = Program(config_of([sys.executable, "-c", script]))
    patience = Patience(60.0)
    while not program.text() and not patience.over:
        program.check()
    child = int(program.text())
    program.close()
    assert not program.running
    patience = Patience(60.0)
    while running(child):
        assert not patience.over


def test_missing_program_is_reported():
    with pytest.raises(FirmwareError, match=r"cannot start no-such-program .*check autopilot.command"):
        Program(config_of(["no-such-program"]))


def test_early_end_shows_last_output():
    program = Program(config_of([sys.executable, "-c", "print('bad board'); raise SystemExit(3)"]))
    program._process.wait()
    with pytest.raises(
        FirmwareError, match=r"the program ended \(exit code 3\) at t = 1 s; its last output: bad board"
    ):
        program.check(" at t = 1 s")
    program.close()


def test_service_of_playback_has_no_link():
    service = betaflight.create(resolve(load("betaflight_quad", QUAD)), {})
    assert isinstance(service, Service)
    assert [block.name for block in service.blocks] == ["betaflight.playback"]
