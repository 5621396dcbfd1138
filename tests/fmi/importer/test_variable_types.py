"""Variables that ports of numbers cannot hold: texts, bytes and clocks, on FMUs through the command `lapwing run`."""

import subprocess
from pathlib import Path

import pytest
from event_fmu import write_event_fmu
from opened_fmu import OpenedFmu
from small_fmu import write_small_fmu

pytest.importorskip("fmpy")

from lapwing import read_log
from tests.commands import assert_rejected, run_command

HOVER = Path("lapwing/scenes/hover.toml").resolve()
SERVICE = """
[services.motor]
fmu = "a.fmu"
start = {{ {start} }}
[services.motor.inputs]
{inputs}
[services.motor.outputs]
"{column}" = "{output}"
"""
VOLTAGE, HEIGHT = "actuators.motor_voltage.0", "trajectory.position_world.2"


def fly(folder: Path, column: str, output: str, inputs: str = "", start: str = "") -> subprocess.CompletedProcess[str]:
    scene = folder / "a.toml"
    scene.write_text(HOVER.read_text() + SERVICE.format(column=column, output=output, inputs=inputs, start=start))
    arguments = ["--mode", "single-process", "--set", "run.duration=0.4", "--set", "success.require=[]"]
    return run_command("run", scene, "--allow-code", "--log", folder / "a.mcap", *arguments)


def test_text_is_start_value(tmp_path: Path) -> None:
    """The text `label` of the FMU sets its gain."""
    write_small_fmu(tmp_path / "a.fmu")
    done = fly(tmp_path, VOLTAGE, "y", f'u = "{VOLTAGE}"', 'label = "0.25"')
    assert done.returncode == 0, done.stderr
    log = read_log(tmp_path / "a.mcap")
    own, scaled = log.topic("actuators").motor_voltage[:, 0], log.topic("custom_sensor/actuators_motor").values[:, 0]
    assert own.max() > 0.0
    assert scaled == pytest.approx(0.25 * own, rel=1e-6)


def test_bytes_are_start_value(tmp_path: Path) -> None:
    """The last byte of `blob`, divided by 256, is the restitution."""
    write_event_fmu(tmp_path / "a.fmu")
    balls = [
        OpenedFmu(tmp_path / "a.fmu", ["h"], ["u"], start=start)
        for start in ({"blob": "ff40"}, {"e": 0.25}, {"e": 0.5})
    ]
    for ball in balls:
        ball.initialise(-9.81, 0.0)
    heights = [[ball.advance(0.1 * k, -9.81, 0.0) for k in range(1, 8)] for ball in balls]
    assert heights[0] == heights[1] != heights[2]


def test_invalid_bytes_are_rejected(tmp_path: Path) -> None:
    write_event_fmu(tmp_path / "a.fmu")
    message = "services.motor.start.blob: expected hexadecimal digits, two for each byte, got '4x' for the type Binary"
    assert_rejected(fly(tmp_path, HEIGHT, "h", start='blob = "4x"'), message)


def test_text_as_input_is_rejected_by_name(tmp_path: Path) -> None:
    write_event_fmu(
        tmp_path / "a.fmu",
        variables='<String name="text" valueReference="15" causality="input"><Start value=""/></String>',
    )
    done = fly(tmp_path, HEIGHT, "h", f'text = "{HEIGHT}"')
    assert_rejected(done, "services.motor.inputs.text: text has the type String; expected a variable of type Real")


CLOCK = '<Clock name="tick" valueReference="20" causality="input" intervalVariability="{}" intervalDecimal="0.1"/>'
COUNT = '<Int32 name="ticks" valueReference="21" causality="output" clocks="20"/>'


@pytest.mark.parametrize("variability", ["constant", "countdown"])
def test_clock_that_importer_must_activate_is_rejected_by_name(tmp_path: Path, variability: str) -> None:
    write_event_fmu(tmp_path / "a.fmu", variables=CLOCK.format(variability))
    message = "input clock tick, which the importer must activate in time, is not supported; expected an FMU without"
    assert_rejected(fly(tmp_path, HEIGHT, "h"), message)


def test_variable_with_clock_is_rejected_by_name(tmp_path: Path) -> None:
    write_event_fmu(tmp_path / "a.fmu", variables=CLOCK.format("triggered") + COUNT)
    done = fly(tmp_path, HEIGHT, "ticks")
    assert_rejected(done, f'services.motor.outputs."{HEIGHT}": ticks changes with the clock tick; expected a variable')
