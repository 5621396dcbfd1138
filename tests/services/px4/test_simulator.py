"""Reverse role: Lapwing's autopilot as the firmware of a simulator with PX4's interface."""

import json
import re
import socket
import subprocess
import sys

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from lapwing.cosim.log import LogReader
from lapwing.dynamics.config_error import ConfigError
from lapwing.flight import Flight
from lapwing.runs.foreign_simulator_run import on_simulator
from lapwing.services.common import ports
from lapwing.services.common.firmware.link import FirmwareError
from lapwing.services.common.ports import (
    AirspeedReading,
    BarometerReading,
    DistanceReading,
    GpsReading,
    ImuReading,
    MagnetometerReading,
)
from lapwing.services.px4.connection import MAVLINK_PORT, PORT
from lapwing.services.px4.framing import frame
from lapwing.services.px4.messages import (
    DISTANCE_SENSOR,
    HIL_GPS,
    HIL_SENSOR,
    actuator_controls,
    distance_values,
    gps_values,
)
from lapwing.services.px4.simulator_client import SimulatorClient
from lapwing.services.px4.simulator_readings import readings
from lapwing.services.scene_resolver import load, resolve
from tests.services.firmware_links import Background, free_instance, never
from tests.services.px4.hil_sensor import Sensors, sensor_values

NOMINAL = {
    ports.IMU: ImuReading(omega_variance=1e-6, specific_force_variance=1e-3),
    ports.MAGNETOMETER: MagnetometerReading(variance=1e-14),
    ports.BAROMETER: BarometerReading(variance=4.0),
    ports.AIRSPEED: AirspeedReading(variance=2.0),
    ports.GPS: GpsReading(velocity_variance=0.01),
    ports.SONAR: DistanceReading(variance=1e-4),
}


def test_readings_invert_messages():
    sent = Sensors((0.1, -0.2, 0.3), (0.5, 0.6, 9.8), (2e-5, -1e-5, -4e-5), 95000.0, 12.0)
    actual = readings(HIL_SENSOR.number, sensor_values(4000, sent), NOMINAL)
    assert actual[ports.IMU] == ImuReading(sent.omega_body, sent.specific_force_body, 1e-6, 1e-3, True)
    assert np.allclose(actual[ports.MAGNETOMETER].field_body, sent.field_body, rtol=1e-12, atol=0.0)
    assert actual[ports.BAROMETER] == BarometerReading(pytest.approx(95000.0, rel=1e-12), 4.0, True)
    assert actual[ports.AIRSPEED] == AirspeedReading(pytest.approx(12.0), 2.0, True)


def test_fix_inverts_message_to_its_resolution():
    fix = GpsReading(47.3977, 8.5456, 488.0, (0.5, 0.5, 2.25), (1.0, -2.0, 0.5), 0.0, 0.0, True)
    actual = readings(HIL_GPS.number, gps_values(4000, fix), NOMINAL)[ports.GPS]
    assert actual.latitude_deg == pytest.approx(fix.latitude_deg, abs=1e-7)
    assert actual.longitude_deg == pytest.approx(fix.longitude_deg, abs=1e-7)
    assert actual.height == pytest.approx(488.0, abs=1e-3)
    assert actual.position_variance == pytest.approx(fix.position_variance, rel=1e-9)
    assert actual.velocity_world == pytest.approx(fix.velocity_world, abs=0.01)
    assert actual.velocity_variance == 0.01


def test_sensors_without_update_have_no_reading():
    assert readings(HIL_SENSOR.number, sensor_values(4000, Sensors(pressure=95000.0)), NOMINAL).keys() == {"barometer"}
    assert readings(HIL_GPS.number, gps_values(4000, GpsReading()), NOMINAL) == {}
    distance = distance_values(4000, DistanceReading(1.23, 0.0, True))
    actual = readings(DISTANCE_SENSOR.number, distance, NOMINAL)
    assert actual == {ports.SONAR: DistanceReading(pytest.approx(1.23), 1e-4, True)}


class Simulator:
    """Scripted simulator with one connection."""

    def __init__(self):
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self.codec = mavlink.MAVLink(None)

    def accept(self):
        self._server.settimeout(60.0)
        self._peer, _ = self._server.accept()
        self._peer.settimeout(60.0)

    def sensor(self, time_us, identifier=0):
        s = Sensors((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), None, None, None)
        return frame(HIL_SENSOR, 0, sensor_values(time_us, s, identifier), 1, 51)

    def send(self, *frames):
        self._peer.sendall(b"".join(frames))

    def answer(self):
        while True:
            for message in self.codec.parse_buffer(self._peer.recv(65536)) or ():
                if message.get_type() == "HIL_ACTUATOR_CONTROLS":
                    return message

    def close(self):
        self._peer.close()
        self._server.close()


@pytest.fixture
def connected():
    simulator = Simulator()
    accepting = Background(simulator.accept)
    client = SimulatorClient("127.0.0.1", simulator.port)
    client.open(never, 20.0)
    accepting.join()
    yield simulator, client
    client.close()
    simulator.close()


def test_messages_are_split_at_sensor_of_first_imu(connected):
    simulator, client = connected
    fix = frame(HIL_GPS, 0, gps_values(0, GpsReading()), 1, 51)
    simulator.send(fix, simulator.sensor(4000, 1), simulator.sensor(4000), fix, simulator.sensor(8000))
    numbers = [[number for number, _ in client.receive(never, 20.0, "")] for _ in range(2)]
    assert numbers == [[113, 107, 107], [113, 107]]


def test_answer_has_time_controls_and_lock_step(connected):
    simulator, client = connected
    client.answer(4000, (0.25, 0.5, 0.75, 1.0), True)
    actual = simulator.answer()
    assert (actual.time_usec, actual.flags, actual.mode) == (4000, 1, 129)
    assert tuple(actual.controls[:5]) == (0.25, 0.5, 0.75, 1.0, 0.0)
    values = (actual.time_usec, actual.flags, *actual.controls, actual.mode)
    assert actuator_controls(values).lock_step


def test_closed_connection_ends_messages(connected):
    simulator, client = connected
    simulator.send(simulator.sensor(4000), b"junk")
    simulator.close()
    assert len(client.receive(never, 20.0, "")) == 1
    assert client.receive(never, 20.0, "") is None
    assert client.report.rejected == 1


def test_silent_simulator_is_reported(connected):
    _, client = connected
    with pytest.raises(FirmwareError, match=r"no HIL_SENSOR from tcp .* for 0.1 s at t = 2 s; check that it runs"):
        client.receive(never, 0.1, "at t = 2 s")


def configure(*overrides):
    scene = load("quad_x", ["communication.rate=250", *overrides])
    with scene.located():
        return on_simulator(scene, resolve(scene), "127.0.0.1", 4560)


def test_configuration_has_no_plant_and_no_sensors():
    setup = configure()
    assert set(setup.services) == {"autopilot", "trajectory", "simulator"}
    own = setup.services["simulator"].parameters
    assert own.order == resolve(load("px4_quad")).services["px4"].parameters.order
    assert own.nominal["imu"].omega_variance > 0.0


@pytest.mark.parametrize(
    ("scene", "override", "key"),
    [
        ("quad_x", "autopilot.estimator=ground_truth", "autopilot.estimator"),
        ("hexacopter", "run.seed=1", "airframe"),
        ("fleet", "run.seed=1", "vehicle"),
        ("px4_quad", "run.seed=1", "autopilot.firmware"),
    ],
)
def test_scene_unsuitable_for_simulator_is_rejected(scene, override, key):
    loaded = load(scene, [override])
    with pytest.raises(ConfigError, match=key.replace(".", r"\.")), loaded.located():
        on_simulator(loaded, resolve(loaded), "127.0.0.1", 4560)


def lapwing(*arguments, timeout=900):
    command = [sys.executable, "-m", "lapwing", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)


@pytest.mark.long
@pytest.mark.parametrize("address", ["4560", "host:", "host:70000", ":4560"])
def test_invalid_address_is_rejected(address, tmp_path):
    done = lapwing("autopilot", "quad_x", "--px4-sim", address, "--log", str(tmp_path / "a.mcap"))
    assert done.returncode == 2
    assert f"--px4-sim {address}: expected HOST:PORT" in done.stderr


@pytest.mark.long
def test_absent_simulator_is_reported(tmp_path):
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        done = lapwing(
            "autopilot", "quad_x", "--px4-sim", f"127.0.0.1:{s.getsockname()[1]}", "--log", str(tmp_path / "a.mcap"),
            "--set", "autopilot.start_timeout=0.5",
        )  # fmt: skip
    assert done.returncode == 1
    assert "simulator: no answer on tcp 127.0.0.1:" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.long
def test_different_simulator_step_is_reported(tmp_path):
    simulator = Simulator()

    def run():
        simulator.accept()
        for k in range(3):
            simulator.send(simulator.sensor(1000 * (k + 1)))
            simulator.answer()

    running = Background(run)
    done = lapwing(
        "autopilot", "quad_x", "--px4-sim", f"127.0.0.1:{simulator.port}", "--log", str(tmp_path / "a.mcap"),
        "--set", "communication.rate=250", "--set", "autopilot.start_timeout=60",
    )  # fmt: skip
    simulator.close()
    assert done.returncode == 1
    assert "it steps by 1 ms, the scene's IMU by 4 ms; set communication.rate" in done.stderr
    with pytest.raises(OSError):  # the connection was closed
        running.join()


@pytest.mark.long
def test_autopilot_flies_plant_of_another_lapwing(tmp_path):
    plant, log, summary = tmp_path / "plant.mcap", tmp_path / "autopilot.mcap", tmp_path / "plant.json"
    instance = free_instance((socket.SOCK_STREAM, PORT, 1), (socket.SOCK_DGRAM, MAVLINK_PORT, 1))
    command = [sys.executable, "-m", "lapwing", "run", "px4_quad", "--mode", "single-process", "--log", str(plant)]
    command += ["--json", str(summary), "--set", f"autopilot.instance={instance}", "--set", "run.duration=36.0"]
    command += ["--set", "autopilot.start_timeout=600", "--set", "success.require=[]"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as simulator:
        try:
            done = lapwing(
                "autopilot", "quad_x", "--px4-sim", f"127.0.0.1:{PORT + instance}", "--log", str(log),
                "--set", "communication.rate=250", "--set", "autopilot.start_timeout=600",
            )  # fmt: skip
            text, _ = simulator.communicate(timeout=600)
        finally:
            simulator.kill()
    assert done.returncode == 0, done.stdout + done.stderr + text
    assert simulator.returncode == 0, text
    assert re.search(r"PX4 simulator: \d+ steps, skew 0 ms, resent 0, late 0, missed 0", done.stdout)
    assert "the simulator closed its connection" in done.stdout
    assert "skew 0 ms, resent 0, late 0, missed 0, rejected 0" in json.loads(summary.read_text())["firmware"][0]
    position = Flight.read(plant).truth.position[:, :2]
    for corner in ((6.0, 0.0), (6.0, 6.0)):
        assert np.linalg.norm(position - corner, axis=1).min() < 0.3
    assert np.linalg.norm(position[-1] - position[0]) < 0.3
    with LogReader(log) as reader:
        times, _ = reader.history("/drone1/estimate")
    assert times[-1] > 30_000_000_000
    again = lapwing("resimulate", str(log))
    assert again.returncode == 2
    assert "simulator was an external service" in again.stderr
