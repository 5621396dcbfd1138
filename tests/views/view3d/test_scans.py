"""Point clouds of lidars and depth cameras in the 3D view, near known surfaces."""

import subprocess
import sys

import numpy as np
import pytest
from flights_in_space import READY, Recorder

import lapwing
from lapwing.flights.flight_data import SHOWN, FlightData
from lapwing.views.view3d import headless as chromium
from lapwing.views.view3d.recording import page
from lapwing.views.view3d.scans import FEWEST, ScanPoints, scans

pytestmark = pytest.mark.long

RINGS = {"sensors.lidar.rings": 6, "sensors.lidar.elevation_min_deg": -40.0, "sensors.lidar.columns": 90}
SCENE = {
    "environment.terrain.box": "[{position=[6.0,0.0],size=[2.0,4.0],top=9.0}]",
    "effects.random_wind_force.mean": "[30.0,15.0,0.0]",  # tilts the vehicle
    "sensors.lidar.preset": "ideal",
    "sensors.depth_camera.preset": "ideal",
    "sensors.lidar.position": "[0.1,0.0,-0.05]",
    "sensors.depth_camera.pitch_deg": 30.0,
    "sensors.depth_camera.position": "[0.2,0.0,0.0]",
    "run.duration": 6.0,
    "success.require": "[]",
}


@pytest.fixture(scope="module", params=[{}, RINGS], ids=["ring", "rings"])
def log(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("scans") / "scans.mcap"
    sets = [part for key, value in (SCENE | request.param).items() for part in ("--set", f"{key}={value}")]
    command = [sys.executable, "-m", "lapwing", "run", "hover", *sets, "--mode", "single-process", "--log", str(path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return path


def distance(points):
    """Return the distance [m] to the nearest surface, ground or a wall of the box, shape (n,)."""
    x, y, z = points.T
    beyond = np.maximum(np.abs(x - 6.0) - 1.0, np.abs(y) - 2.0)  # distance from the box in plan view, negative inside
    return np.minimum(np.abs(z), np.where(z > 0.0, np.abs(beyond), np.inf))


def test_points_of_log_lie_on_surfaces(log):
    flight = FlightData.read(log, only=SHOWN)
    times = np.linspace(1.0, 6.0, 51)
    result = {one.name: one for one in scans(flight, times)}
    assert set(result) == {"lidar", "depth_camera"}
    assert np.abs(flight.truth.attitude[:, :2]).max() > 0.03
    for one in result.values():
        assert np.diff(one.times) == pytest.approx(0.1)
        assert np.all(one.times[one.latest] <= times + 1e-9)
        assert np.all(one.times[one.latest] > times - 0.1 - 1e-9)
        world = np.concatenate([points + origin for points, origin in zip(one.points, one.origins, strict=True)])
        assert len(world) > 200
        assert distance(world).max() < 2e-3
        assert (world[:, 2] > 0.1).sum() > 20  # on the wall


def test_points_are_equal_in_log_and_in_whole_flight(log):
    times = np.linspace(0.0, 3.0, 7)
    whole, part = (scans(FlightData.read(log, only=only), times) for only in (None, SHOWN))
    for one, other in zip(whole, part, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one.points, other.points, strict=True))


def test_points_of_long_recording_are_few(log):
    flight = FlightData.read(log, only=SHOWN)
    for one in scans(flight, np.linspace(0.0, 6.0, 181), 3000):
        assert np.diff(one.times).min() >= 0.2 - 1e-6
        assert sum(map(len, one.points)) <= max(3000, FEWEST * len(one.points))
    assert scans(flight, np.array([2.0]), 3000)[0].times == pytest.approx([2.0])


def test_flight_in_memory_has_points():
    box = [{"position": [6.0, 0.0], "size": [2.0, 4.0], "top": 9.0}]
    overrides = {"run.duration": 2.0, "sensors.lidar.preset": "ideal", "success.require": []}
    flight = lapwing.fly("hover", {"environment.terrain.box": box, **overrides})
    (one,) = scans(flight, np.array([1.0, 1.5]))
    assert distance(np.concatenate([p + o for p, o in zip(one.points, one.origins, strict=True)])).max() < 2e-3


def test_flight_without_instruments_has_no_points():
    assert scans(lapwing.fly("hover", {"run.duration": 0.2, "success.require": []}), np.array([0.0, 0.1])) == []


def test_cloud_is_sent_once_for_each_scan(log):
    one, scene = scans(FlightData.read(log, only=SHOWN), np.linspace(1.0, 1.2, 21))[0], Recorder()
    cloud = ScanPoints(scene, (0, 0, 0), "/lidar")
    sent = []
    for k in range(21):
        scene.nodes["/lidar"].points = None
        cloud.show(one, k)
        sent.append(scene.nodes["/lidar"].points is not None)
    assert np.flatnonzero(sent).tolist() == [0, 10, 20]
    assert scene.nodes["/lidar"].visible


@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_browser_shows_points_and_hides_their_layer(log, tmp_path):
    pytest.importorskip("viser", reason="needs viser (pip install lapwing[view3d])")
    flight, path = FlightData.read(log, only=SHOWN), tmp_path / "view.html"
    path.write_text(page([flight], ["drone1"]), encoding="utf-8")
    with chromium.Browser(path, size=(640, 360)) as browser:
        counts, shown, rows = browser.run(
            READY
            + """
            const nodes = ["/0 drone1/lidar", "/0 drone1/depth_camera"], shown = [];
            const node = (name) => __viserMutable.nodeRefFromName[name];
            lapwingView.seek(3.0);
            await until(() => nodes.every((name) => node(name)?.visible));
            const counts = nodes.map((name) => {
              let count = 0;
              node(name).traverse(({ geometry }) => (count = geometry?.attributes.position?.count ?? count));
              return count;
            });
            document.querySelector("#lapwing details").open = true;
            await until(() => document.querySelector("#lapwing [name=wind]").parentElement.hidden === false);
            const rows = [...document.querySelectorAll("#lapwing label")].filter((row) => !row.hidden);
            for (const wanted of [false, true]) {
              document.querySelector("#lapwing [name=sensors]").click();
              await until(() => nodes.every((name) => node(name).visible === wanted));
              lapwingView.seek(wanted ? 4.0 : 3.5);
              await until(() => lapwingView.time > 3.4);
              shown.push(nodes.map((name) => node(name).visible));
            }
            return [counts, shown, rows.map((row) => row.textContent)];
            """
        )
        assert browser.errors == []
    assert all(count > 50 for count in counts)
    assert shown == [[False, False], [True, True]]
    assert rows == ["reference", "estimate", "sensors", "wind"]
