"""The vehicle in space on the report's page: what the page is given, and that a browser draws and plays it."""

import base64
import copy
import json
import re

import chromium
import numpy as np
import pytest
import synthetic_flights

from lapwing.services.common.mesh_file import Mesh
from lapwing.services.common.mesh_schema import pack
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_provenance import Origin
from lapwing.studies.report import motion_3d, shapes, write
from lapwing.studies.report.motion_3d import FRAMES
from lapwing.studies.report.style import COLOURS
from lapwing.studies.topic_view import TopicView
from tests.golden.digests import sample_file

TICKS, RATE = 400, 100
T = np.arange(TICKS) / RATE
HUBS = [[0.3, 0.3, 0.0], [-0.3, 0.3, 0.0], [-0.3, -0.3, 0.0], [0.3, -0.3, 0.0]]
AIRFRAME = {
    "rotors": {"position": HUBS, "spin_direction": ["cw", "ccw", "cw", "ccw"]},
    "propeller": {"diameter": 0.5},
    "contact": {"feet": [[0.2, 0.2, -0.3]]},
    "mass": {"payload": 2.0},
}


def flight(model="rigid_body", ticks=TICKS, scene=None, **topics):
    """Up at 1 m/s, rotors at 10 rad/s, wind of 3 m/s along x."""
    t = np.arange(ticks) / RATE
    truth = {
        "pose.position": np.column_stack([0.0 * t, 0.0 * t, t]),
        "pose.orientation": synthetic_flights.LEVEL,
        "rotor_speed": (10.0,) * 4,
        **dict.fromkeys(("motor_voltage", "motor_current", "motor_power", "rotor_thrust", "rotor_torque"), (1.0,) * 4),
        "velocity": (0.0, 0.0, 1.0),
        "acceleration": (0.0,) * 3,
        "air_density": 1.2,
        "wind": (3.0, 0.0, 0.0),
        "ground_contact": np.zeros(ticks, bool),
    }
    told = {"vehicle": {"model": model}, **({"airframe": AIRFRAME} if scene is None else scene)}
    return synthetic_flights.flight(ticks, RATE, scene=told, ground_truth=truth, **topics)


def numbers(text, kind="<f4"):
    return np.frombuffer(base64.b64decode(text), kind)


def test_the_page_is_given_the_motion_and_the_shape_of_the_airframe():
    (table,) = json.loads(motion_3d.to_json([flight()]))["flights"]
    assert numbers(table["t"], "<f8") == pytest.approx(T)
    assert numbers(table["path"]).reshape(-1, 3)[:, 2] == pytest.approx(T)
    assert numbers(table["wind"])[:3] == pytest.approx([3.0, 0.0, 0.0])
    (body,) = table["bodies"]
    assert [numbers(hub).tolist() for hub, _, _ in body["rotors"]] == pytest.approx(np.array(HUBS))
    assert [radius for _, radius, _ in body["rotors"]] == [0.25] * 4
    clockwise, counter = (numbers(angle) for _, _, angle in body["rotors"][:2])
    assert counter[:60] == pytest.approx(10.0 * T[:60], abs=1e-5)  # seen from above, as the mathematician turns
    assert clockwise[1:60] == pytest.approx(2.0 * np.pi - 10.0 * T[1:60], abs=1e-5)


def test_a_long_flight_is_thinned_to_its_ends():
    (table,) = json.loads(motion_3d.to_json([flight(ticks=5000)]))["flights"]
    times = numbers(table["t"], "<f8")
    assert len(times) == FRAMES
    assert (times[0], times[-1]) == (0.0, 49.99)


def fleet():
    """Two vehicles, the second 4 m north of the first."""
    first = flight()
    truth = {name: first.truth[name] for name in first.truth.fields}
    truth["pose.position"] = first.truth.position + np.array([0.0, 4.0, 0.0])
    second = FlightData({"ground_truth": TopicView(np.arange(TICKS) * 10**7, truth)}, copy.copy(first.origin))
    second.vehicle = "second"
    first.others = (second,)
    first.fleet = {"second": second.truth, first.vehicle: first.truth}
    return first


def test_a_fleet_is_shown_together_the_vehicle_of_the_report_first_and_each_in_its_colour():
    tables = json.loads(motion_3d.to_json([fleet()]))["flights"]
    assert [table["name"] for table in tables] == ["drone1", "second"]
    assert [table["colour"] for table in tables] == [COLOURS[1], COLOURS[0]]  # as in the plot of all paths
    assert [numbers(table["path"])[1] for table in tables] == [0.0, 4.0]


def test_two_flights_laid_over_each_other_have_the_names_of_their_logs():
    tables = json.loads(motion_3d.to_json([fleet(), flight()]))["flights"]
    assert len(tables) == 2
    assert len({table["name"] for table in tables}) == 2


@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_a_browser_draws_a_fleet_and_its_camera_follows_whom_one_chooses(tmp_path):
    given = fleet()
    given.digest = "0" * 32
    with chromium.Browser(write(given, tmp_path / "flight.html"), tmp_path / "profile") as browser:
        names, hubs, centres = browser.run(
            """
            const until = async (holds) => { while (!holds()) await new Promise((done) => setTimeout(done, 20)); };
            await until(() => document.readyState === "complete");
            const section = document.getElementById("motion"), whom = section.querySelector("[name=whom]");
            await until(() => section.dataset.time !== undefined);
            const space = section.querySelector(".space"), centres = [];
            for (const chosen of [0, 1]) {
              whom.value = chosen;
              whom.dispatchEvent(new Event("change"));
              const centre = () => space.layout.scene.yaxis.range.reduce((low, high) => (low + high) / 2);
              await until(() => Math.abs(centre() - 4 * chosen) < 0.1);
              centres.push(centre());
            }
            const arms = space.data.filter(({ line }) => line && line.width === 6);
            const names = [...whom.options].map(({ text }) => text);
            return [names, arms.map(({ y }) => [Math.min(...y), Math.max(...y)]), centres];
            """
        )
        assert browser.errors == []
    assert names == ["drone1", "second"]
    assert centres == pytest.approx([0.0, 4.0])
    assert [min(low for low, _ in hubs), max(high for _, high in hubs)] == pytest.approx([-0.3, 4.3], abs=0.01)


def test_bodies_move_each_by_itself_and_have_their_forces():
    place = np.zeros((TICKS, 5, 3))
    place[:, :, 2] = T[:, None]
    bodies = {
        "name": np.full((TICKS, 5), "body", object),
        "pose": np.concatenate([place, np.tile(synthetic_flights.LEVEL, (TICKS, 5, 1))], axis=2),
        "force": place,
    }
    (table,) = json.loads(motion_3d.to_json([flight("multibody", body_states=bodies)]))["flights"]
    assert len(table["bodies"]) == 5
    assert [len(body["rotors"]) for body in table["bodies"]] == [0, 1, 1, 1, 1]
    assert numbers(table["bodies"][2]["f"]).reshape(-1, 3)[:, 2] == pytest.approx(T)


SLING = {"mass": 0.4, "length": 2.0, "hook": [0.1, 0.0, -0.1]}
OFF = {**AIRFRAME, "mass": {"payload": 0.0, "centre": [0.1, 0.0, 0.2]}}


def slung():
    """A load 1.5 m below the hook: on a slack cable for the first half, pulled for the second."""
    place = np.zeros((TICKS, 1, 3))
    place[:, 0, 2] = T - 0.3 - 1.5
    force = np.where((np.arange(TICKS) < TICKS // 2)[:, None, None], 0.0, [[[0.0, 0.0, 4.0]]])
    load = {
        "name": np.full((TICKS, 1), "load", object),
        "pose": np.concatenate([place, np.tile(synthetic_flights.LEVEL, (TICKS, 1, 1))], axis=2),
        "force": force,
    }
    return flight("slung_load", scene={"airframe": OFF, "slung_load": SLING}, body_states=load)


def test_a_load_hangs_by_a_cable_from_the_hook_and_all_places_are_from_the_centre_of_mass():
    (table,) = json.loads(motion_3d.to_json([slung()]))["flights"]
    vehicle, load = table["bodies"]
    assert numbers(vehicle["rotors"][0][0]) == pytest.approx(np.array(HUBS[0]) - OFF["mass"]["centre"], abs=1e-6)
    assert np.ptp(numbers(load["strokes"][0][0]).reshape(-1, 3), axis=0) == pytest.approx([0.1] * 3)  # 1 l of 0.4 kg
    (link,) = table["links"]
    assert link[:2] == [0, 1]
    assert link[2] == pytest.approx([0.0, 0.0, -0.3])
    assert link[3] == 2.0


def test_a_body_that_tells_less_often_moves_evenly_in_between():
    whole = slung()
    seldom = TopicView(
        np.arange(0, TICKS, 10) * 10**7, {k: whole.topic("body_states")[k][::10] for k in ("name", "pose", "force")}
    )
    views = {name: whole.topic(name) for name in whole.topics} | {"body_states": seldom}
    (table,) = json.loads(motion_3d.to_json([FlightData(views, whole.origin)]))["flights"]
    heights = numbers(table["bodies"][1]["p"]).reshape(-1, 3)[:, 2]
    assert heights[: TICKS - 10] == pytest.approx(T[: TICKS - 10] - 1.8, abs=1e-5)


def test_a_vehicle_without_a_shape_has_its_axes():
    (table,) = json.loads(motion_3d.to_json([flight("something new", scene={})]))["flights"]
    assert len(table["bodies"][0]["strokes"]) == 3


def test_no_model_is_drawn_twice():
    models = [model for module in shapes.modules() for model in module.MODELS]
    assert len(models) == len(set(models))


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "flight.html"
    given = flight()
    given.digest = "0" * 32  # of messages, which this flight has not
    return write(given, path)


def test_the_page_needs_no_network(page):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)=", text)
    assert text.index('id="motion"') < text.index('id="position"')


@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_a_browser_draws_it_plays_it_and_ties_it_to_the_plots(page, tmp_path):
    with chromium.Browser(page, tmp_path / "profile") as browser:
        played, asked, cursor = browser.run(
            """
            const until = async (holds) => { while (!holds()) await new Promise((done) => setTimeout(done, 20)); };
            await until(() => document.readyState === "complete");
            const section = document.getElementById("motion"), play = section.querySelector("[name=play]");
            await until(() => section.dataset.time !== undefined);
            play.click();
            await until(() => Number(section.dataset.time) > 0.1);
            if (play.textContent === "Pause") play.click();
            const played = Number(section.dataset.time);

            document.dispatchEvent(new CustomEvent("plot-time", { detail: 2.5 }));
            await until(() => Number(section.dataset.time) === 2.5);
            const space = section.querySelector(".space"), [low, high] = space.layout.scene.zaxis.range;

            const figure = document.querySelector("#position figure");
            figure.scrollIntoView();
            await until(() => figure.querySelector(".js-plotly-plot"));
            const slider = section.querySelector("[name=time]");
            await until(() => {
              slider.value = 1.0;
              slider.dispatchEvent(new Event("input"));
              return figure.querySelector(".hoverlayer text");
            });
            return [played, (low + high) / 2, figure.querySelector(".hoverlayer").textContent];
            """
        )
        assert browser.errors == []
    assert 0.1 < played <= 3.99
    assert asked == pytest.approx(2.5)  # the camera follows the vehicle, which rises at 1 m/s
    assert re.match(r"(0\.99|1)\S* s", cursor)  # the cursor of a plot that can be seen


@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_a_browser_draws_a_cable_straight_where_it_pulls_and_as_long_as_it_is_where_it_is_slack(tmp_path):
    given = slung()
    given.digest = "0" * 32
    with chromium.Browser(write(given, tmp_path / "flight.html"), tmp_path / "profile") as browser:
        slack, taut = browser.run(
            """
            const until = async (holds) => { while (!holds()) await new Promise((done) => setTimeout(done, 20)); };
            await until(() => document.readyState === "complete");
            const section = document.getElementById("motion"), slider = section.querySelector("[name=time]");
            await until(() => section.dataset.time !== undefined);
            const cable = async (time) => {
              slider.value = time;
              slider.dispatchEvent(new Event("input"));
              await until(() => Math.abs(Number(section.dataset.time) - time) < 0.01);
              const grey = ({ line }) => line && line.color === "#9AA5AF" && line.width === 3;
              const { x, y, z } = section.querySelector(".space").data.find(grey);
              return x.map((_, k) => [x[k], y[k], z[k]]).filter(([value]) => value !== null);
            };
            return [await cable(1), await cable(3)];
            """
        )
        assert browser.errors == []
    for line, time in ((slack, 1.0), (taut, 3.0)):
        assert line[0] == pytest.approx([0.0, 0.0, time - 0.3], abs=0.01)
        assert line[-1] == pytest.approx([0.0, 0.0, time - 1.8], abs=0.01)
    assert len(taut) == 2
    assert np.linalg.norm(np.diff(slack, axis=0), axis=1).sum() == pytest.approx(2.0, rel=0.05)


def standing():
    """50 N on each of two feet, which are 0.4 m apart; told half as often as the truth."""
    place, force = np.zeros((TICKS // 2, 2, 3)), np.zeros((TICKS // 2, 2, 3))
    place[:, 0, 0], place[:, 1, 0], force[:, :, 2] = 0.2, -0.2, 50.0
    whole = flight()
    contact = TopicView(np.arange(0, TICKS, 2) * 10**7, {"position": place, "force": force})
    return FlightData({**{name: whole.topic(name) for name in whole.topics}, "contact_forces": contact}, whole.origin)


def test_the_page_is_given_the_forces_on_every_foot_where_they_are_told():
    (table,) = json.loads(motion_3d.to_json([standing()]))["flights"]
    assert table["contact"]["points"] == 2
    assert numbers(table["contact"]["p"]).reshape(-1, 2, 3)[:, :, 0] == pytest.approx(np.tile([0.2, -0.2], (TICKS, 1)))
    assert numbers(table["contact"]["f"]).reshape(-1, 2, 3)[:, :, 2] == pytest.approx(50.0)
    assert json.loads(motion_3d.to_json([flight()]))["flights"][0]["contact"] is None


@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_a_browser_draws_the_forces_on_the_feet_when_it_is_asked_to(tmp_path):
    given = standing()
    given.digest = "0" * 32
    with chromium.Browser(write(given, tmp_path / "flight.html"), tmp_path / "profile") as browser:
        hidden, before, after = browser.run(
            """
            const until = async (holds) => { while (!holds()) await new Promise((done) => setTimeout(done, 20)); };
            await until(() => document.readyState === "complete");
            const section = document.getElementById("motion"), forces = section.querySelector("[name=forces]");
            await until(() => section.dataset.time !== undefined);
            const drawn = () => {
              const { data } = section.querySelector(".space");
              const arrows = data.find(({ name }) => name === "force of contact or joint");
              const { x, y, z } = arrows;
              return x.map((_, k) => [x[k], y[k], z[k]]).filter(([value]) => value !== null);
            };
            if (forces.checked) forces.click();
            await until(() => drawn().length === 0);
            const before = drawn();
            forces.click();
            await until(() => drawn().length > 0);
            return [forces.parentElement.hidden, before, drawn()];
            """
        )
        assert browser.errors == []
    assert not hidden
    assert before == []
    points = np.array(after).reshape(2, -1, 3)  # from, tip, and the barbs of each
    assert points[:, 0] == pytest.approx(np.array([[0.2, 0.0, 0.0], [-0.2, 0.0, 0.0]]), abs=1e-6)
    assert points[:, 1, 2] == pytest.approx(1.0)  # 0.02 m for 1 N


TRIANGLE = Mesh(np.array([(0.5, 0.0, 0.0), (0.0, 0.25, 0.0), (0.0, 0.0, 0.125)]), np.array([(0, 1, 2)]))
WITH_MESH = {"airframe": {**AIRFRAME, "mesh": "a.stl"}, "meshes": {"a.stl": pack(TRIANGLE)}}


@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_a_browser_draws_the_mesh_where_the_vehicle_is_and_as_it_is_turned(tmp_path):
    plain = flight(scene=WITH_MESH)
    truth = {name: plain.truth[name] for name in plain.truth.fields}
    truth["pose.orientation"] = np.tile([0.0, 0.0, 0.5**0.5, 0.5**0.5], (TICKS, 1))  # x of the body points north
    given = FlightData({"ground_truth": TopicView(np.arange(TICKS) * 10**7, truth)}, plain.origin)
    given.digest = "0" * 32
    with chromium.Browser(write(given, tmp_path / "flight.html"), tmp_path / "profile") as browser:
        x, y, z, face = browser.run(
            """
            const until = async (holds) => { while (!holds()) await new Promise((done) => setTimeout(done, 20)); };
            await until(() => document.readyState === "complete");
            const section = document.getElementById("motion"), slider = section.querySelector("[name=time]");
            await until(() => section.dataset.time !== undefined);
            slider.value = 3;
            slider.dispatchEvent(new Event("input"));
            await until(() => Math.abs(Number(section.dataset.time) - 3) < 0.01);
            const { x, y, z, i, j, k } = section.querySelector(".space").data.find(({ type }) => type === "mesh3d");
            return [x, y, z, [i[0], j[0], k[0]]];
            """
        )
        assert browser.errors == []
    assert x == pytest.approx([0.0, -0.25, 0.0], abs=1e-6)
    assert y == pytest.approx([0.5, 0.0, 0.0], abs=1e-6)
    assert z == pytest.approx([3.0, 3.0, 3.125], abs=0.01)
    assert face == [0, 1, 2]


def test_a_flight_that_goes_on_tells_its_mesh_once():
    for first in (True, False):
        (table,) = json.loads(motion_3d.steps_to_json([flight(scene=WITH_MESH)], [[]], first))["flights"]
        assert [body["surface"] is not None for body in table["bodies"]] == [first]


@pytest.mark.parametrize(
    ("scene", "bodies", "rotors", "links"),
    [
        ("hover", 1, 4, 0),
        ("delivery_full", 1, 4, 0),
        ("gyrostat_attitude", 1, 0, 0),
        ("os4_motors", 1, 4, 0),
        ("cooperative_load", 3, 8, 2),
        ("slung_load", 2, 4, 1),
        ("unload", 8, 0, 0),
    ],
)
def test_every_kind_of_scene_is_drawn_in_its_own_shape(scene, bodies, rotors, links):
    recorded = FlightData.read(sample_file(scene))  # the samples carry no set-up
    views = {name: recorded.topic(name) for name in recorded.topics}
    found = motion_3d.motion(FlightData(views, Origin.of_setup(resolve(load(scene)))))
    assert (len(found.bodies), sum(len(body.rotors) for body in found.bodies), len(found.links)) == (
        bodies,
        rotors,
        links,
    )
    assert all(body.strokes or body.rotors or body.force is not None for body in found.bodies)
