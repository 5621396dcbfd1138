"""Complete runs with PX4 as the autopilot: a scripted program, and the real one if PX4 is set."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lapwing.api.flight import Flight
from lapwing.cosim.log import LogReader
from lapwing.cosim.scene.scene_error import SceneError
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.scene_resolver import load, resolve
from tests.participants import running
from tests.services.firmware_links import fly, lapwing, program, scripted

SCENE = Path(__file__).parents[3] / "lapwing/scenes/px4_quad.toml"
HEXACOPTER = "--set", "vehicle.airframe=hexacopter"
COUNTS = "skew 0 ms, resent 0, late 0, missed 0, rejected 0"


@pytest.mark.long
def test_scripted_firmware_flies_and_resimulates(tmp_path):
    log = tmp_path / "flight.mcap"
    fly("px4", scripted("px4"), "--log", log)
    with LogReader(log) as reader:
        report = reader.metadata["firmware"]
    assert report.startswith("px4: ")
    assert COUNTS in report
    lapwing("resimulate", log)


@pytest.mark.long
def test_scripted_firmware_flies_hexacopter(tmp_path):
    """All rotors push and turn alike, so the vehicle stays level and keeps its heading."""
    log = tmp_path / "flight.mcap"
    fly("px4", scripted("px4", "--rotors", 6), "--log", log, *HEXACOPTER)
    truth = Flight.read(log).truth
    assert truth.position[:, 2].max() > 1.5
    assert np.abs(truth.angular_velocity[truth.position[:, 2] > 0.5]).max() < 1e-3


@pytest.mark.long
def test_stalled_firmware_is_reported_and_log_readable(tmp_path):
    log = tmp_path / "flight.mcap"
    result = fly("px4", scripted("px4", "--stall"), "--log", log, "--set", "autopilot.step_timeout=2.0", code=1)
    assert "px4: no HIL_ACTUATOR_CONTROLS for 2 s at t = " in result.stderr
    with LogReader(log) as reader:
        times, _ = reader.history("/drone1/ground_truth")
    assert times[-1] > 2_000_000_000


@pytest.mark.long
@pytest.mark.parametrize(
    ("mode", "number"), [("single-process", signal.SIGINT), ("single-process", signal.SIGTERM),
                         ("multi-process", signal.SIGTERM)]
)  # fmt: skip
def test_signal_ends_run_whose_firmware_never_answers(tmp_path, mode, number):
    options = "--mode", mode, "--log", tmp_path / "a.mcap", "--set", "autopilot.start_timeout=3000"
    words = "run", "px4_quad", *options, *program(scripted("px4", "--silent", tmp_path / "pid"))
    run = subprocess.Popen([sys.executable, "-m", "lapwing", *map(str, words)], stderr=subprocess.PIPE, text=True)
    try:
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
            assert run.poll() is None, run.stderr.read()
            time.sleep(0.1)
        run.send_signal(number)
        error = run.communicate(timeout=300.0)[1]
    finally:
        run.kill()
    assert (run.returncode, error) == (128 + number, f"lapwing: ended by {number.name}\n")
    assert not running(int((tmp_path / "pid").read_text()))


@pytest.mark.long
def test_stopped_firmware_loses_no_step(tmp_path):
    assert COUNTS in fly("px4", scripted("px4", "--stop"), "--log", tmp_path / "flight.mcap").stdout


def test_shell_is_that_of_the_firmware(tmp_path):
    program = "--set", f"autopilot.command={json.dumps([sys.executable, '-c', 'print(input()[::-1]); exit(3)'])}"
    log = "--log", tmp_path / "a.mcap"
    done = lapwing("run", "px4_quad", "--shell", *program, *log, stdin="stats rev\n", code=1)
    assert "ver stats" in done.stdout
    assert "px4: the program ended (exit code 3) at its start" in done.stderr
    assert "autopilot.shell" in lapwing("run", "px4_quad", "--shell", *log, code=2).stderr
    several = lapwing("run", "px4_quad", "--shell", "--mode", "multi-process", *program, *log, code=2).stderr
    assert "--shell: needs --mode single-process" in several


@pytest.mark.long
def test_missing_program_is_reported(tmp_path):
    result = fly("px4", ["/nowhere/px4"], "--log", tmp_path / "a.mcap", code=2)
    assert "autopilot.command: cannot start /nowhere/px4; expected path of a program" in result.stderr
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.long
def test_missing_working_directory_is_reported(tmp_path):
    folder = "--set", f"autopilot.directory={tmp_path}/nowhere"
    result = fly("px4", [sys.executable], *folder, "--log", tmp_path / "a.mcap", code=2)
    assert "autopilot.directory: no folder" in result.stderr


def test_delays_of_sensors_are_parameters_of_firmware():
    def parameters(*overrides):
        return resolve(load("px4_quad", overrides)).services["px4"].parameters.own.parameters

    assert parameters("sensors.barometer.latency_samples=2").items() >= {
        "SENS_GPS0_DELAY": 100.0, "EKF2_BARO_DELAY": 40.0, "EKF2_MAG_DELAY": 0.0, "IMU_INTEG_RATE": 250.0,
        "EKF2_DELAY_MAX": 200.0, "SIM_BAT_ENABLE": 0.0, "SIM_BAT_DRAIN": 0.0, "COM_FLTT_LOW_ACT": 1.0,
    }.items()  # fmt: skip
    assert parameters("sensors.gps.latency_samples=3")["EKF2_DELAY_MAX"] == 300.0


def test_missing_sensor_is_rejected(tmp_path):
    scene = SCENE.read_text().replace("[sensors.barometer]\n", "").replace("plans/", f"{SCENE.parent}/plans/")
    (tmp_path / "scene.toml").write_text(scene)
    with pytest.raises((ConfigError, SceneError), match=r"needs \[sensors.barometer\]"):
        resolve(load(tmp_path / "scene.toml"))


def test_invalid_mission_is_rejected(tmp_path):
    (tmp_path / "bad.plan").write_text("{}")
    (tmp_path / "scene.toml").write_text(SCENE.read_text().replace("plans/square_px4.plan", "bad.plan"))
    assert "px4.mission" in lapwing("check", tmp_path / "scene.toml", code=2).stderr


FURTHER = [
    *("--set", "sensors.imu.instances=3", "--set", "sensors.gps.instances=2"),
    *("--set", "sensors.magnetometer.instances=2", "--set", "sensors.optical_flow.preset=pmw3901"),
    *("--set", "sensors.rangefinder.preset=lidar_lite_v3", "--set", "sensors.external_vision.preset=motion_capture"),
    *("--set", "px4.rc=[[0.0, 1500, 1500, 1000, 1500]]"),
]
KINDS = ["HIL_GPS 1", "HIL_OPTICAL_FLOW 0", "HIL_SENSOR 1", "HIL_SENSOR 2", "ODOMETRY 0", "RC_CHANNELS 0"]


def test_further_sensors_and_radio_reach_the_firmware(tmp_path):
    command = scripted("px4", "--received", tmp_path / "received.txt")
    result = fly("px4", command, "--log", tmp_path / "flight.mcap", *FURTHER)
    assert "Landed" in result.stdout
    assert set(KINDS) <= set((tmp_path / "received.txt").read_text().splitlines())


def test_radio_rows_with_equal_times_are_rejected():
    done = lapwing("check", "px4_quad", "--set", "px4.rc=[[1.0, 1500], [1.0, 1600]]", code=2)
    assert "px4.rc: expected rows with increasing times" in done.stderr


def test_own_autopilot_rejects_a_second_receiver():
    done = lapwing("check", "delivery_full", "--set", "sensors.gps.instances=2", code=2)
    assert "sensors.gps.instances: Lapwing's autopilot uses one" in done.stderr


@pytest.mark.long
@pytest.mark.skipif("PX4" not in os.environ, reason="PX4 names no px4 program")
@pytest.mark.parametrize("vehicle", [(), HEXACOPTER, FURTHER], ids=["quadrotor", "hexacopter", "further sensors"])
def test_px4_flies_its_square(tmp_path, vehicle):
    log, binary = tmp_path / "flight.mcap", Path(os.environ["PX4"]).resolve()
    command = [str(binary), "-d", str(binary.parents[1] / "etc")]
    environment = 'autopilot.environment={PX4_SIM_MODEL = "none_iris"}'
    links = "autopilot.instance=8"  # missions go to instances 0 to 9 only
    result = fly("px4", command, "--log", log, "--set", environment, "--set", links, *vehicle)
    assert "Landed" in result.stdout
    with LogReader(log) as reader:
        assert "skew 0 ms" in reader.metadata["firmware"]
    largest = 0.03 if vehicle is FURTHER else 0.02  # [s] it has steps of 0.02
    assert abs(lag_of_estimate(tmp_path / "flight.px4.ulg", log)) < largest
    lapwing("validate", "px4_quad", tmp_path / "flight.px4.ulg", *vehicle, "--json", tmp_path / "errors.json")
    (flight,) = json.loads((tmp_path / "errors.json").read_text())["flights"].values()
    assert flight["thrust_ratio"] == pytest.approx(1.0, abs=0.02)


def lag_of_estimate(ulog, log):
    """Return the time [s] by which PX4's estimated path is behind the true one."""
    from pyulog import ULog

    (estimate,) = ULog(str(ulog), ["vehicle_local_position"]).data_list
    truth = Flight.read(log).truth
    x, y = estimate.data["y"], estimate.data["x"]  # NED
    return lag(1e-6 * estimate.data["timestamp_sample"], np.stack([x, y], 1), truth.times, truth.position[:, :2])


def lag(times, path, true_times, true_path):
    """Return the delay [s] of a path, whose clock is a whole number of seconds ahead of the true one's."""
    speed = np.abs(np.diff(path, axis=0)).sum(axis=1) / np.diff(times)
    moving = np.append(speed > 0.5, False)
    times, path = times[moving], path[moving]

    def error(delay):
        expected = [np.interp(times - delay, true_times, values) for values in true_path.T]
        return np.square(path - np.stack(expected, 1) - (path - np.stack(expected, 1)).mean(axis=0)).sum()

    second = min(range(240), key=error)
    return min(np.arange(-0.5, 0.5, 0.005), key=lambda delay: error(second + delay))


def test_lag_of_path_is_measured():
    t = np.arange(0.0, 20.0, 0.02)

    def path(time):
        return np.stack([5.0 * np.sin(0.5 * time), 3.0 * np.cos(0.3 * time)], 1)

    assert lag(t + 7.0, path(t - 0.095) + 1.0, t, path(t)) == pytest.approx(0.095, abs=0.006)
