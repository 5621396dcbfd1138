"""Sensors of a fleet that see the other vehicles, by the real command: distances, messages, equal bits."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lapwing.cosim.config.serialise import first_difference, from_json, to_json
from lapwing.dynamics.vehicles.visible_body import visible_body
from lapwing.flights.flight_data import FlightData
from lapwing.messages.topics import LASER_SCAN
from lapwing.services.common.schemas.vehicle_schema import airframe
from lapwing.services.mavlink.telemetry.external_sensors import obstacle_distance
from lapwing.services.scene_resolver import load, parse, reseed, resolve
from tests.commands import run_command
from tests.scenes import head, phase

WIND = {"wind_constant": "velocity = [5.0, 3.0, 0.0]"}
SCENE = (
    (head(1.0, "body_drag", run="seed = 3", **WIND) + phase("climb", 1.0, "trajectory", z=1.0))
    + """
[[vehicle]]
name = "seeing"
airframe = "delivery_drone"
initial_position = [0.0, 3.0]
[vehicle.sensors.lidar]
preset = "ideal"
columns = 720
position = [0.1, 0.0, -0.2]  # the small vehicle is below the origin
range_max = 30.0
[vehicle.sensors.rangefinder]
preset = "ideal"
azimuth_deg = -90.0
position = [0.0, 0.0, -0.2]
elevation_deg = 0.0
range_max = 30.0
[vehicle.sensors.depth_camera]
preset = "ideal"
width = 21
height = 15
[[vehicle]]
name = "seen"
airframe = "quad_x"
initial_position = [0.0, 0.5]
[vehicle.autopilot]
gains = "quad_x"
[[vehicle]]
name = "ahead"
airframe = "delivery_drone"
initial_position = [4.0, 3.0]
"""
)


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    file = tmp_path_factory.mktemp("fleet") / "see.toml"
    file.write_text(SCENE)
    return file


def run(file, mode):
    """Run the scene as a process. Return the path of the log, and the digest."""
    log, out = file.with_name(f"{mode}.mcap"), file.with_name(f"{mode}.json")
    run_command("run", file, "--mode", mode, "--log", log, "--json", out, "--set", "success.require=[]", code=0)
    return log, json.loads(out.read_text())["digest"]


@pytest.fixture(scope="module")
def flown(scene_file):
    return run(scene_file, "single-process")


def poses(log, vehicle, times):
    """Return positions (n, 3) [m] and rotations of a vehicle at the times [s] of messages."""
    truth = FlightData.read(log, vehicle).truth
    rows = np.searchsorted(truth.times, times - 1e-6)
    return truth.position[rows], Rotation.from_quat(truth.orientation[rows])


def test_only_ranging_sensors_read_other_vehicles(scene_file):
    config = resolve(load(scene_file))
    inputs = [i.port for i in config.services["sensors"].inputs]
    assert inputs == ["seeing/truth", "seen/truth", "ahead/truth"]
    assert first_difference(from_json(to_json(config)), config) is None
    assert first_difference(reseed(config, 9), resolve(load(scene_file, ["run.seed=9"]))) is None
    blind = resolve(load("fleet")).services["sensors"]
    assert [i.port for i in blind.inputs] == ["scout/truth"]


def test_single_vehicle_sees_no_vehicles(tmp_path):
    head, _, tail = SCENE.partition("[[vehicle]]")
    alone = head + tail.partition("[[vehicle]]")[0].replace("[vehicle.sensors", "[sensors")
    alone = alone.replace('name = "seeing"', '[vehicle]\nname = "seeing"')
    sensors = resolve(parse(tmp_path / "alone.toml", alone)).services["sensors"]
    assert [i.port for i in sensors.inputs] == ["truth"]
    assert all(instrument.others == () for instrument in sensors.parameters)


@pytest.mark.long
def test_lidar_returns_lie_on_bodies_of_others(flown, scene_file):
    """Compare with the recorded poses: each return on a cylinder in the frame of its vehicle, both vehicles met."""
    log, _ = flown
    scan = FlightData.read(log, "seeing").topic("scan")
    own, attitude = poses(log, "seeing", scan.times)
    assert np.degrees(attitude.magnitude()).max() > 0.5  # tilted by the wind
    angle = np.arange(720) * math.tau / 720 - math.pi
    rays = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(720)])
    met = {"seen": 0, "ahead": 0}
    scenes = {vehicle.lookup("vehicle.name"): vehicle for vehicle in load(scene_file).vehicles}
    for k in range(len(scan)):
        returned = scan.ranges[k] < 3.5  # not the ground
        points = own[k] + attitude[k].apply(rays * np.where(returned, scan.ranges[k], 0.0)[:, None] + (0.1, 0.0, -0.2))
        on_any = np.zeros(720, bool)
        for name in met:
            body, (position, turned) = visible_body(airframe(scenes[name])), poses(log, name, scan.times)
            x, y, z = turned[k].inv().apply(points - position[k]).T
            off = np.hypot(x - body.x, y - body.y) - body.radius
            side = (np.abs(off) < 1e-5) & (body.bottom - 1e-5 <= z) & (z <= body.top + 1e-5)
            ends = (off <= 1e-5) & (np.minimum(np.abs(z - body.bottom), np.abs(z - body.top)) < 1e-5)
            met[name] += np.count_nonzero(returned & (side | ends))
            on_any |= side | ends
        assert on_any[returned].all()
    assert min(met.values()) > 100


@pytest.mark.long
def test_distance_is_that_between_vehicles(flown, scene_file):
    """Before the start, both are level: the distance of the places less the radius; from the lidar, as messages too."""
    log, _ = flown
    _, seen, ahead = (visible_body(airframe(vehicle)) for vehicle in load(scene_file).vehicles)
    flight = FlightData.read(log, "seeing")
    scan = flight.topic("scan")
    to_right, to_front = 2.5 - seen.radius, 4.0 - 0.1 - ahead.radius
    assert flight.topic("rangefinder").range[0] == pytest.approx(to_right, abs=1e-6)
    assert scan.ranges[0, 360] == pytest.approx(to_front, abs=1e-6)
    fields = {name: scan[name][0] for name in ("ranges", "angle_min", "angle_increment", "range_min", "range_max")}
    newest = {LASER_SCAN: SimpleNamespace(**fields)}
    sectors = obstacle_distance(SimpleNamespace(get=newest.get, boot_us=0)).distances
    assert (sectors[0], sectors[18], sectors[36]) == (round(100.0 * to_front), round(100.0 * to_right), 3001)
    depth = np.ascontiguousarray(flight.topic("depth/image_rect").data[0].astype(np.uint8)).view("<f4").reshape(15, 21)
    assert depth[7, 10] == pytest.approx(4.0 - ahead.radius, abs=1e-6)


@pytest.mark.long
def test_digest_is_equal_in_processes_and_resimulation(flown, scene_file):
    log, digest = flown
    assert run(scene_file, "multi-process")[1] == digest
    done = run_command("resimulate", log)
    assert f"digest {digest}" in done.stdout, done.stdout + done.stderr
