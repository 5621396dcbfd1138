"""Leader-follower trajectories against their definition and finite differences."""

import math

import numpy as np
import pytest

from lapwing.cosim.diagram.multi_vehicle import member
from lapwing.cosim.scene import SceneError
from lapwing.flights.mission import mission_of
from lapwing.services.scene_resolver import parse, resolve
from lapwing.services.trajectory.leader_follower import step
from tests.cosim.memory_log import fly
from tests.scenes import head, phase, vehicle

LEADER = vehicle(
    "leader",
    phase("climb", 2.0, z=3.0),
    phase("turn", 4.0, x=5.0, yaw=1.5),
    phase("down", 2.0, z=0.0),
    start=(1.0, 0.5),
)
FOLLOWS = 'autopilot = { gains = "quad_x" }\n[vehicle.trajectory]\nleader = "leader"'
CLOSER = phase("beside", 3.0) + phase("closer", 2.0, x=1.0, yaw=0.3)
SCENE = head(2.0) + LEADER + vehicle("wing", FOLLOWS, CLOSER, start=(-2.0, 1.5), airframe="quad_x")


def path(tmp_path, vehicle="wing", *overrides):
    return resolve(parse(tmp_path / "two.toml", SCENE, overrides)).services["trajectory"].parameters.given[
        ["leader", "wing"].index(vehicle)
    ].parameters.core  # fmt: skip


def follower_setpoint(core, tick):
    return step(core, 0.0, tick, ())[1][0]


def leader_setpoint(core, tick):
    from lapwing.services.trajectory import block as trajectory_block

    return trajectory_block.step(core.leader, 0.0, tick, ())[1][0]


def test_follower_keeps_its_place_relative_to_leader(tmp_path):
    core = path(tmp_path)
    start, end = follower_setpoint(core, 0), follower_setpoint(core, 2500)
    assert start.position_world[:2] == pytest.approx((-2.0, 1.5))
    x, y = -3.0 + 1.0, 1.0
    rotated = (math.cos(1.5) * x - math.sin(1.5) * y, math.sin(1.5) * x + math.cos(1.5) * y)
    assert end.position_world[:2] == pytest.approx((6.0 + rotated[0], 0.5 + rotated[1]))
    assert end.position_world[2] == pytest.approx(start.position_world[2])  # at the follower's resting height
    assert end.yaw == pytest.approx(1.8)
    assert (follower_setpoint(core, 1400).final, follower_setpoint(core, 1600).final) == (False, True)
    assert [follower_setpoint(core, tick).phase for tick in (0, 800)] == [0, 1]


def test_world_frame_displacement_does_not_rotate(tmp_path):
    core = path(tmp_path, "wing", "vehicle.1.trajectory.frame=world")
    for tick in (0, 900, 1300, 2500):
        apart = np.subtract(follower_setpoint(core, tick).position_world, leader_setpoint(core, tick).position_world)
        assert apart[1] == pytest.approx(1.0)
    assert apart[0] == pytest.approx(-2.0)


@pytest.mark.parametrize("tick", [700, 900, 1100, 1300])
def test_follower_derivatives_match_finite_differences(tmp_path, tick):
    core, h = path(tmp_path), 0.004
    before, now, after = (follower_setpoint(core, tick + k) for k in (-1, 0, 1))
    for value, slope in (("position_world", "velocity_world"), ("velocity_world", "acceleration_world")):
        result = np.subtract(getattr(after, value), getattr(before, value)) / (2.0 * h)
        assert getattr(now, slope) == pytest.approx(result, abs=2e-4)
    assert now.yaw_rate == pytest.approx((after.yaw - before.yaw) / (2.0 * h), abs=1e-4)


def test_follower_setpoint_follows_leader(tmp_path):
    scene = parse(tmp_path / "two.toml", SCENE)
    flight = fly(resolve(scene))
    reported, core = flight.view("wing/setpoint"), path(tmp_path)
    assert reported.position[400] == pytest.approx(follower_setpoint(core, 400).position_world)
    assert flight.messages("wing/setpoint")[400].phase == "beside"
    assert flight.view("wing/ground_truth").position[-1] == pytest.approx(reported.position[-1], abs=0.15)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("vehicle.1.trajectory.leader=lead", "vehicle.1.trajectory.leader: expected .* no leader: leader, got lead"),
        ("vehicle.0.trajectory.leader=wing", "vehicle.0.trajectory.leader: expected .* there is none"),
        ("vehicle.1.trajectory.leader=wing", "vehicle.1.trajectory.leader: expected a vehicle with a trajectory"),
        ("vehicle.0.trajectory.frame=world", "trajectory.frame: has no leader"),
    ],
)  # fmt: skip
def test_invalid_leader_is_rejected(tmp_path, override, message):
    with pytest.raises(SceneError, match=message):
        resolve(parse(tmp_path / "two.toml", SCENE, [override]))


def test_phases_equal_to_leaders_are_rejected(tmp_path):
    text = SCENE.split('[[vehicle.trajectory.phase]]\nname = "beside"')[0]
    climb = SCENE.split("[[vehicle]]")[1].split("initial_position = [1.0, 0.5]\n")[1]
    text = text.replace("[[vehicle]]", climb.replace("vehicle.", "") + "[[vehicle]]", 1).replace(climb, "", 1)
    with pytest.raises(SceneError, match=r"vehicle.1.trajectory.phase: .*repeats the phases of leader"):
        resolve(parse(tmp_path / "two.toml", text))


@pytest.mark.parametrize(("duration", "cut_short"), [(2.0, True), (7.5, True), (9.0, False)])
def test_short_run_of_follower_completes(tmp_path, duration, cut_short):
    """The leader ends its trajectory at 8 s, the follower its displacement at 5 s."""
    config = resolve(parse(tmp_path / "two.toml", SCENE, [f"run.duration={duration}"]))
    for name in ("leader", "wing"):
        mission = mission_of(member(config, name), np.zeros(3))
        assert mission.is_longer is cut_short


def test_follower_that_ends_in_air_completes(tmp_path):
    config = resolve(parse(tmp_path / "two.toml", SCENE.replace("to = 0.0", "to = 2.0"), ["run.duration=20.0"]))
    assert mission_of(member(config, "wing"), np.zeros(3)).final_phase == "closer"
    config = resolve(parse(tmp_path / "two.toml", SCENE, ["run.duration=20.0"]))
    assert mission_of(member(config, "wing"), np.zeros(3)).final_phase is None
