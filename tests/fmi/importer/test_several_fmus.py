"""Scenes with several FMUs, which Lapwing's own blocks connect, through the command `lapwing run`."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from small_fmu import write_small_fmu

pytest.importorskip("fmpy")

from lapwing import read_log
from tests.commands import run_command

HOVER = Path("lapwing/scenes/hover.toml").resolve()
FILTER, MOTOR = "trajectory.position_world.2", "actuators.motor_voltage.0"
SCENE = """
[services.motor]
fmu = "small.fmu"
start = {{ gain = {motor_gain} }}
[services.motor.inputs]
u = "{motor_input}"
[services.motor.outputs]
"actuators.motor_voltage.0" = "y"
[services.filter]
fmu = "small.fmu"
timeout = 600.0
start = {{ gain = {gain}, fault = {fault} }}
[services.filter.inputs]
u = "{filter_input}"
[services.filter.outputs]
"trajectory.position_world.2" = "y"
"""
HANG = 2
OPTIONS = "--allow-code", "--set", "run.duration=1.0", "--set", "success.require=[]"


def scene_with(
    folder: Path,
    gain: float = 1.0,
    motor_gain: float = 1.0,
    fault: int = 0,
    motor_input: str = MOTOR,
    filter_input: str = FILTER,
) -> Path:
    path = folder / "two.toml"
    values = {"gain": gain, "motor_gain": motor_gain, "fault": fault}
    path.write_text(HOVER.read_text() + SCENE.format(motor_input=motor_input, filter_input=filter_input, **values))
    return path


def fly(scene: Path, log: Path, mode: str = "single-process") -> None:
    run_command("run", scene, "--mode", mode, "--log", log, *OPTIONS, code=0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmus")
    write_small_fmu(path / "small.fmu")
    return path


@pytest.mark.long
@pytest.mark.parametrize("mode", ["single-process", "multi-process"])
def test_fmus_before_and_after_autopilot_step_in_one_tick(folder: Path, mode: str) -> None:
    logs = [folder / f"{name}_{mode}.mcap" for name in ("plain", "two")]
    fly(HOVER, logs[0], mode)
    fly(scene_with(folder), logs[1], mode)
    plain, two = (read_log(log).truth for log in logs)
    assert np.array_equal(plain.position, two.position)
    assert np.array_equal(plain.motor_voltage, two.motor_voltage)


@pytest.mark.long
@pytest.mark.parametrize(("source", "gain"), [(FILTER, 3.0), ("filter.y", 6.0)])
def test_fmu_reads_port_of_lapwing_or_of_other_fmu(folder: Path, source: str, gain: float) -> None:
    log = folder / "column.mcap"
    fly(scene_with(folder, gain=2.0, motor_gain=3.0, motor_input=source), log)
    read = read_log(log)
    voltage, height = (read.topic(f"custom_sensor/{name}").values for name in ("actuators_motor", "trajectory_filter"))
    assert np.ptp(height[:, 2]) > 0.0
    assert np.array_equal(2.0 * voltage[:, 0], gain * height[:, 2])


def test_algebraic_loop_through_fmu_is_rejected_in_one_line(folder: Path) -> None:
    scene = scene_with(folder, filter_input=MOTOR)
    done = run_command("run", scene, "--log", folder / "loop.mcap", *OPTIONS, code=2)
    message = "an algebraic loop through autopilot, filter_fmu; expected delay = 1"
    assert f"services.filter.delay: {message}" in done.stderr
    assert done.stderr.count("\n") == 1


def host_processes(parent: int) -> list[int]:
    """Return the processes of FMUs among the children of a process.

    Other children, such as a compiler's, may end between the two readings.
    """
    result = []
    with suppress(OSError):
        for child in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
            with suppress(OSError):
                if b"lapwing.fmi.importer.host" in Path(f"/proc/{child}/cmdline").read_bytes():
                    result.append(int(child))
    return result


def test_each_fmu_has_process_and_killed_one_is_named(folder: Path) -> None:
    """The FMU `filter` hangs; `motor` waits for a request when the operating system kills it."""
    scene, log = scene_with(folder, fault=HANG), folder / "killed.mcap"
    arguments = ["run", str(scene), "--mode", "single-process", "--log", str(log), *OPTIONS]
    command = [sys.executable, "-m", "lapwing", *arguments]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as run:
        while len(hosts := host_processes(run.pid)) < 2 and run.poll() is None:
            time.sleep(0.05)
        assert len(set(hosts)) == 2
        for each in hosts:
            os.kill(each, signal.SIGKILL)
        text = run.stderr.read()
    assert run.returncode == 1
    assert "small.fmu: crashed (SIGKILL) at t = " in text


CHARGE = """
[effects.battery]
[services.gauge]
fmu = "small.fmu"
start = { gain = 0.05 }
[services.gauge.inputs]
u = "battery.charge"
[services.gauge.outputs]
"battery.charge" = "y"
"""


@pytest.mark.long
@pytest.mark.parametrize("mode", ["single-process", "multi-process"])
def test_failsafe_acts_on_battery_of_fmu(folder: Path, mode: str) -> None:
    """The autopilot lands with a battery that is nearly empty."""
    scene, log = folder / "charge.toml", folder / f"charge_{mode}.mcap"
    scene.write_text(HOVER.read_text() + CHARGE)
    fly(scene, log, mode)
    assert "the battery is critical" in [str(event.text) for event in read_log(log).events]
