"""Complete runs with ArduPilot as the autopilot: a scripted program, or the real one (ARDUCOPTER)."""

import json
import os
import socket
from pathlib import Path

import numpy as np
import pytest

from lapwing.api.flight import Flight
from lapwing.cosim.log import LogReader
from lapwing.dynamics.config_error import ConfigError
from lapwing.runs.resimulate import recorded_config
from lapwing.services.ardupilot.link import MAVLINK_PORT, STRIDE
from lapwing.services.scene_resolver import load, resolve
from tests.services.firmware_links import fly, lapwing, program, scripted

SPINS = json.dumps(["cw", "ccw"] * 3)  # the shipped hexacopter has another order, which ArduPilot does not fly
HEXACOPTER = "--set", "vehicle.airframe=hexacopter", "--set", f"airframe.rotors.spin_direction={SPINS}"


def run(folder, *options, seconds=15.0, settings=(), code=None):
    """Fly with the scripted program."""
    log, duration = folder / "flight.mcap", f"run.duration={seconds}"
    return fly("ardupilot", scripted("ardupilot", *options), "--log", log, "--set", duration, *settings, code=code)


@pytest.mark.long
def test_scripted_firmware_flies_and_resimulates(tmp_path):
    assert "leaves the ground" in run(tmp_path, settings=("--firmware-schedule", "3")).stdout
    with LogReader(tmp_path / "flight.mcap") as reader:
        report, repeatable = reader.metadata["firmware"], reader.metadata["repeatable"]
        assert recorded_config(reader).services["ardupilot"].parameters.schedule == 3
    assert repeatable == "yes"
    assert "skew 0 ms, resent 0, late 0, missed 0, rejected 0, reconnected 0" in report
    lapwing("resimulate", tmp_path / "flight.mcap")


@pytest.mark.long
def test_scripted_firmware_turns_hexacopter_without_a_tilt(tmp_path):
    run(tmp_path, "--rotors", 6, "--yaw", 0.05, seconds=9.0, settings=HEXACOPTER)
    truth = Flight.read(tmp_path / "flight.mcap").truth
    rate = truth.angular_velocity[truth.position[:, 2] > 0.5]
    assert truth.position[:, 2].max() > 1.5
    assert rate[:, 2].max() > 0.1  # to the left
    assert np.abs(rate[:, :2]).max() < 1e-3


@pytest.mark.long
def test_flight_with_stopped_firmware_is_the_same(tmp_path):
    """A debugger stops ArduPilot for longer than the time-out."""
    timeout = "--set", "autopilot.step_timeout=1.0"
    outputs = [run(tmp_path, *options, seconds=5.0, settings=timeout).stdout for options in ([], ["--stop"])]
    first, second = (next(line for line in text.splitlines() if line.startswith("digest")) for text in outputs)
    assert first == second


@pytest.mark.long
def test_program_end_in_flight_is_reported_with_its_output(tmp_path):
    result = run(tmp_path, "--die", settings=("--set", "autopilot.repeatable=false"), code=1)
    with LogReader(tmp_path / "flight.mcap") as reader:
        assert reader.metadata["repeatable"] == "no: autopilot.repeatable = false"
    assert "ardupilot: the program ended (exit code 1) at t = 4.00" in result.stderr
    assert "its last output: crashed on purpose" in result.stderr
    assert "crashed on purpose" in (tmp_path / "flight.ardupilot.txt").read_text()
    assert (tmp_path / "flight.ardupilot.bin").read_text().startswith("FMT")


@pytest.mark.long
def test_own_log_of_firmware_agrees_with_scene(tmp_path):
    """The motor commands in the firmware's log produce the measured force, also without a measured voltage."""
    run(tmp_path, seconds=9.0)
    lines = (tmp_path / "flight.ardupilot.bin").read_text().splitlines(keepends=True)
    for kept in ("", "BAT"):
        log, result = tmp_path / f"without{kept}.log", tmp_path / f"without{kept}.json"
        log.write_text("".join(line for line in lines if not kept or kept not in line))
        lapwing("validate", "ardupilot_quad", log, "--json", result)
        (flight,) = json.loads(result.read_text())["flights"].values()
        assert flight["thrust_ratio"] == pytest.approx(1.0, abs=0.02)


@pytest.mark.long
def test_outputs_in_own_log_drive_the_rotors_of_the_scene(tmp_path):
    """ArduPilot numbers its outputs in another order than the scenes their rotors."""
    run(tmp_path, "--yaw", 0.02, seconds=9.0)
    log = (tmp_path / "flight.ardupilot.bin").rename(tmp_path / "flight.log")
    errors = []
    for scene in ("ardupilot_quad", "px4_quad"):  # the same vehicle, with the outputs in its own order
        lapwing("validate", scene, log, "--json", tmp_path / "errors.json")
        comparisons = json.loads((tmp_path / "errors.json").read_text())["verdict"]["comparisons"]
        (rate,) = (c["baselines"] for c in comparisons if (c["signal"], c["time"]) == ("rate", 0.01))
        errors.append(rate["constant_velocity"]["ratio"])
    assert errors[0] < 0.5 < 2.0 < errors[1]


@pytest.mark.long
def test_campaign_with_two_workers_finds_free_ports_and_leaves_no_files(tmp_path):
    """A program keeps its ports for a while after the request to end, and another simulator has those of instance 1."""
    temporary, starts = tmp_path / "tmp", tmp_path / "starts.txt"
    temporary.mkdir()
    with socket.create_server(("127.0.0.1", MAVLINK_PORT + STRIDE)):
        lapwing(
            "campaign", "ardupilot_quad", "--runs", 6, "--out", tmp_path / "campaign", "--workers", 2,
            "--set", "run.duration=2.0", "--set", "effects.body_drag.linear=[0,0,0]",
            "--vary", "effects.body_drag.linear.0=uniform(0,0.01)",
            *program(scripted("ardupilot", "--slow-exit", 0.5, "--starts", starts)),
            TMPDIR=str(temporary),
        )  # fmt: skip
    started = [tuple(map(int, line.split())) for line in starts.read_text().splitlines()]
    assert len(started) == 6
    assert 1 not in {instance for instance, _ in started}
    assert list(temporary.glob("lapwing_*")) == []


def test_slow_exchange_is_rejected():
    with pytest.raises(ConfigError, match="ArduPilot's loop runs at 400 Hz"):
        resolve(load("ardupilot_quad", ["communication.rate=250"]))


def test_missing_imu_is_rejected():
    with pytest.raises(ConfigError, match="needs an IMU"):
        resolve(load("ardupilot_quad", ["ardupilot.inertial=sensors"]))


def test_mission_is_part_of_configuration():
    plan = resolve(load("ardupilot_quad")).services["ardupilot"].parameters.plan
    actions = [item.action for command in plan for item in command.items]
    assert actions == ["takeoff", *["waypoint"] * 4, "yaw", "loiter_time", "land"]


@pytest.mark.long
@pytest.mark.skipif("ARDUCOPTER" not in os.environ, reason="ARDUCOPTER names no arducopter program")
@pytest.mark.parametrize("vehicle", [(), HEXACOPTER], ids=["quadrotor", "hexacopter"])
def test_arducopter_flies_its_square(tmp_path, vehicle):
    log, binary = tmp_path / "flight.mcap", Path(os.environ["ARDUCOPTER"]).resolve()
    assert "Landed" in fly("ardupilot", [binary], "--log", log, *vehicle).stdout
    with LogReader(log) as reader:
        assert "skew 0 ms" in reader.metadata["firmware"]
        assert reader.metadata["repeatable"] == "yes"
    lapwing("resimulate", log)  # the firmware flies again
    own = tmp_path / "flight.ardupilot.bin"
    lapwing("validate", "ardupilot_quad", own, *vehicle, "--json", tmp_path / "errors.json")
    (flight,) = json.loads((tmp_path / "errors.json").read_text())["flights"].values()
    assert flight["thrust_ratio"] == pytest.approx(1.0, abs=0.02)
