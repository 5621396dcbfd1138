"""The `[fence]` table: as written in a scene, through `lapwing run` and `lapwing check`."""

import math

import numpy as np
import pytest

from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import enu_to_geodetic
from lapwing.flights.flight_data import FlightData
from lapwing.kernels import python_function
from lapwing.services.common.schemas.fence_schema import FenceTable
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.simulate import fly
from tests.commands import assert_rejected, run_command

CIRCLE = "fence.keep_out=[{position = [6.0, 3.5], radius = 2.0}]"  # on the square of quad_x
SQUARE = "fence.keep_in=[{corners = [[-5, -5], [9, -5], [9, 9], [-5, 9]]}]"
PLAN = {"fileType": "Plan", "mission": {"items": [], "firmwareType": 12}, "rallyPoints": {"points": []}}


def uploads(*overrides, plans=()):
    """Return the shapes (action, number of items) of each fence that the autopilot receives, and all its commands."""
    config = resolve(load("quad_x", overrides), dict(plans)).services["autopilot"].parameters
    fences = [[item.action for item in command.items] for command in config.plan if command.kind == "fence_upload"]
    return fences, [command.kind for command in config.plan], config.operator


def test_areas_become_an_upload():
    fences, kinds, operator = uploads(CIRCLE, SQUARE)
    assert fences == [["fence_inclusion"] * 4 + ["fence_circle_out"]]
    assert (kinds, operator) == (["fence_upload", "finish"], True)
    assert uploads() == ([], [], False)
    assert uploads(CIRCLE, "autopilot.accept_commands=true")[1] == ["fence_upload"]


def test_fence_of_a_plan_replaces_that_of_the_scene():
    with_fence = resolve(load("quad_x", [SQUARE])).services["autopilot"].parameters.plan[:1]
    empty = (with_fence[0]._replace(items=()),)
    accept = "autopilot.accept_commands=true"
    assert uploads(CIRCLE, accept, plans={"drone1": with_fence})[0] == [["fence_circle_out"], ["fence_inclusion"] * 4]
    assert uploads(CIRCLE, accept, plans={"drone1": empty})[0] == [["fence_circle_out"]]


def test_all_vehicles_of_a_fleet_have_the_fence():
    config = resolve(load("fleet", ["fence.keep_out=[{position = [50, 50], radius = 2.0}]"]))
    plans = [vehicle.parameters.plan for vehicle in config.services["autopilot"].parameters.given]
    assert [[command.kind for command in plan] for plan in plans] == [["fence_upload", "finish"]] * len(plans)


def test_places_may_be_latitudes_and_longitudes():
    home = STANDARD.home
    latitude, longitude, _ = python_function(enu_to_geodetic)(home, (12.0, -7.0, 0.0))
    place = f"{{latitude_deg = {latitude!r}, longitude_deg = {longitude!r}}}"
    circle, polygon = f"{{position = {place}, radius = 2.0}}", f"{{corners = [[9, 9], {place}, [9, -9]]}}"
    fence = load("quad_x", [f"fence.keep_out=[{circle}, {polygon}]"])[FenceTable]
    places = [fence.keep_out[0].position, fence.keep_out[1].corners[1]]
    np.testing.assert_allclose(places, [(12.0, -7.0)] * 2, atol=1e-6)
    assert fence.keep_out[1].corners[0] == (9.0, 9.0)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("fence.keep_out=[{radius = 3.0}]", "fence.keep_out.0: expected corners, or position and radius, got radius"),
        ("fence.keep_out=[{}]", "fence.keep_out.0: expected corners, or position and radius, got nothing"),
        ("fence.keep_in=[{corners = [[1, 2], [3, 4]]}]", "fence.keep_in.0.corners: expected at least 3 of them"),
        (
            "fence.keep_in=[{position = [9, 9], radius = 3.0}]",
            "fence: the start at x = 0 m, y = 0 m is outside of the geofence; expected another fence or start",
        ),
        (
            "fence.keep_in=[{position = {latitude_deg = 91, longitude_deg = 0}, radius = 3.0}]",
            "fence.keep_in.0.position.latitude_deg: expected a number at least -90",
        ),
        ("fence.keepin=[]", "unknown key 'keepin'; did you mean keep_in?"),
    ],
)
def test_invalid_fence_is_one_line(override, message):
    assert_rejected(run_command("check", "quad_x", "--set", override), message)


@pytest.mark.parametrize(
    ("scene", "override", "warnings"),
    [
        ("quad_x", SQUARE, []),
        ("quad_x", CIRCLE, ["trajectory: x = 6.0 m, y = 1.5 m at t = 11.4 s in phase 'left' is in a keep-out area"]),
        (
            "formation",
            "fence.keep_out=[{position = [9.0, 0.0], radius = 1.0}]",  # the wing man is led there
            ["wing: trajectory: x = 8.2 m, y = -0.6 m at t = 11.9 s in phase 'formation' is in a keep-out area"],
        ),
    ],
)
def test_trajectory_outside_the_fence_is_a_warning(scene, override, warnings):
    done = run_command("check", scene, "--set", override, code=0)
    expected = [f"lapwing: warning: {text} of the geofence; move it or the fence" for text in warnings]
    assert done.stderr.splitlines() == expected


def test_firmware_has_its_own_fence():
    assert_rejected(run_command("check", "px4_quad", "--set", CIRCLE), "fence: is not uploaded to px4")


@pytest.mark.long
def test_vehicle_returns_from_the_fence_and_its_log_repeats(tmp_path):
    words = ("run", "quad_x", "--mode", "single-process", "--log", "fence.mcap")
    done = run_command(*words, "--set", CIRCLE, code=4, folder=tmp_path)
    assert "the vehicle has entered a keep-out area" in done.stdout
    flight = FlightData.read(tmp_path / "fence.mcap")
    assert 1.5 < flight.truth.position[:, 1].max() < 5.0  # of 6 m: it enters the area at y = 1.5 m, and turns back
    assert math.hypot(*flight.truth.position[-1, :2]) < 0.2
    assert "identical" in run_command("resimulate", "fence.mcap", code=0, folder=tmp_path).stdout


@pytest.mark.long
def test_flight_within_the_fence_is_as_without_one():
    free, fenced = fly(load("quad_x")), fly(load("quad_x", [SQUARE]))
    assert np.array_equal(free.truth.position, fenced.truth.position)


@pytest.mark.long
def test_log_of_a_fleet_with_a_fence_repeats(tmp_path):
    words = ("run", "fleet", "--mode", "single-process", "--log", "fleet.mcap", "--set", "run.duration=8.0")
    done = run_command(*words, "--set", "fence.keep_out=[{position = [50, 50], radius = 2.0}]", folder=tmp_path)
    assert (tmp_path / "fleet.mcap").exists(), done.stderr
    assert "identical" in run_command("resimulate", "fleet.mcap", code=0, folder=tmp_path).stdout
