"""Trajectories: phases, pieces, points of tables."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lapwing.cosim.scene import SceneError
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.scene_resolver import load
from lapwing.services.trajectory import trajectory_compiler
from lapwing.services.trajectory.phases import Phases
from lapwing.services.trajectory.polynomial_piece import (
    Channel,
    Parameters,
    Piece,
    channel_at,
    evaluate,
    last_not_after,
)
from lapwing.services.trajectory.trajectory_compiler import CompiledTrajectory

RAMP = {"kind": "ramp", "to": 10.0, "rate": 1.0}
DELIVERY = [
    {"name": "climb", "z": RAMP},
    {"name": "hover", "duration": 5.0},
    {"name": "forward", "x": RAMP},
    {"name": "stay", "duration": 5.0},
    {"name": "left", "y": RAMP},
    {"name": "stop", "duration": 5.0},
    {"name": "turn", "yaw": {"kind": "ramp", "to": math.pi / 2, "rate": 0.3}},
    {"name": "wait", "duration": 5.0},
    {"name": "descend", "z": {"kind": "ramp", "to": 0.0, "rate": 1.0}},
]
TURN = math.pi / 2 / 0.3


def compile(tables: dict, *origin) -> CompiledTrajectory:
    """Return the compiled trajectory of scene tables."""
    return trajectory_compiler.compile(Phases.model_validate(tables), *origin)


def test_delivery_mission_reaches_corners_on_time():
    parameters, phases, duration, _ = compile({"phase": DELIVERY}, (0.0, 0.0, 0.35))
    assert phases == tuple(phase["name"] for phase in DELIVERY)
    assert duration == pytest.approx(60.0 + TURN, abs=1e-12)
    corners = {0.0: (0, 0, 0), 10.0: (0, 0, 10), 15.0: (0, 0, 10), 25.0: (10, 0, 10), 40.0: (10, 10, 10)}
    for t, (x, y, z) in corners.items():
        assert evaluate(parameters, t, 0).position_world == (x, y, z + 0.35)
    for k, t in enumerate((0.0, 10.0, 15.0, 25.0, 30.0, 40.0, 45.0, 45.0 + TURN, 50.0 + TURN)):
        assert evaluate(parameters, t, 0).phase == k
        assert evaluate(parameters, t + 1e-6, 0).phase == k
    assert evaluate(parameters, 4.0, 0).velocity_world == (0.0, 0.0, 1.0)
    assert evaluate(parameters, 12.0, 0).velocity_world == (0.0, 0.0, 0.0)
    assert evaluate(parameters, 46.0, 0).yaw_rate == pytest.approx(0.3, rel=1e-15)
    end = evaluate(parameters, duration, 0)
    assert (end.position_world, end.yaw, end.velocity_world) == ((10.0, 10.0, 0.35), math.pi / 2, (0.0, 0.0, 0.0))


def test_phase_lasts_as_long_as_its_longest_channel():
    phase = {
        "name": "both",
        "x": {"kind": "ramp", "to": 1.0, "duration": 2.0},
        "y": [RAMP, {"kind": "hold", "duration": 3.0}],
    }
    parameters, _, duration, _ = compile({"phase": [phase]})
    assert duration == 13.0
    assert evaluate(parameters, 5.0, 0).position_world == (1.0, 5.0, 0.0)
    assert evaluate(parameters, 12.0, 0).velocity_world == (0.0, 0.0, 0.0)


def test_step_is_instantaneous():
    parameters, _, duration, _ = compile(
        {"phase": [{"name": "a", "duration": 1.0}, {"name": "b", "x": {"kind": "step", "to": 2.0}}]}
    )
    assert duration == 1.0
    assert channel_at(parameters.x, 0.999)[0] == 0.0
    assert channel_at(parameters.x, 1.0)[0] == 2.0


SEGMENTS = st.one_of(
    st.builds(lambda d: {"kind": "hold", "duration": d}, st.floats(0.1, 3.0)),
    st.builds(lambda to, d: {"kind": "ramp", "to": to, "duration": d}, st.floats(-5.0, 5.0), st.floats(0.1, 3.0)),
    st.builds(lambda to, d: {"kind": "smoothstep", "to": to, "duration": d}, st.floats(-5.0, 5.0), st.floats(0.1, 3.0)),
    st.builds(
        lambda to, d: {"kind": "minimum_jerk", "to": to, "duration": d}, st.floats(-5.0, 5.0), st.floats(0.1, 3.0)
    ),
    st.builds(
        lambda a, d: {"kind": "sine", "amplitude": a, "frequency": 0.7, "duration": d},
        st.floats(0.1, 2.0),
        st.floats(0.1, 3.0),
    ),
)


@given(st.lists(st.tuples(SEGMENTS, SEGMENTS), min_size=1, max_size=6))
@settings(deadline=None, max_examples=60)
def test_segments_except_step_are_continuous(pairs):
    phases = [{"name": str(k), "x": list(pair), "duration": 7.0} for k, pair in enumerate(pairs)]
    parameters, *_ = compile({"phase": phases})
    assert all(np.diff(parameters.x.start) > 0.0)
    for start in parameters.x.start[1:]:
        assert channel_at(parameters.x, start)[0] == pytest.approx(channel_at(parameters.x, start - 1e-9)[0], abs=1e-6)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (
            {"phase": [{"name": "a", "duration": 1.0, "z": RAMP}]},
            "trajectory.phase.0.duration: expected at least the duration of its segments, 10 s, got 1 s in phase 'a'",
        ),
        (
            {"phase": [{"name": "a", "x": [RAMP, {"kind": "table", "points": [[0.0, 3.0], [1.0, 4.0]]}]}]},
            "trajectory.phase.0.x.points.0.1: the table starts at 3.0, but the channel is at 10.0: put a ramp",
        ),
    ],
)
def test_inconsistent_phases_are_rejected(spec, message):
    with pytest.raises(ConfigError, match=r"\A[^\n]+\Z") as error:
        compile(spec)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("trajectory={}", "trajectory.phase: missing; expected a list of tables"),
        ("trajectory.phase=[]", "at least 1"),
        (
            "trajectory.phase.0.z.kind=rump",
            "phase.0.z.kind: unknown kind of segment 'rump'; did you mean ramp? expected",
        ),
        ("trajectory.phase.0.z.kind=[3.0]", "phase.0.z.kind: unknown kind of segment [3.0]; expected one of chirp"),
        (
            "trajectory.phase.0.z=3.0",
            "trajectory.phase.0.z: expected a table with a kind of segment (chirp, hold, mini",
        ),
        (
            "trajectory.phase.0.z={kind='hold', duration=-1}",
            "phase.0.z.duration: expected a number above 0 [s], got -1",
        ),
        (
            "trajectory.phase.0.z=[{kind='hold', duration=-1}]",
            "phase.0.z.0.duration: expected a number above 0 [s], got -1",
        ),
        ("trajectory.phase.0.z={kind='ramp', to=1.0}", "exactly one of rate and duration"),
        ("trajectory.phase.0.q=1.0", "trajectory.phase.0.q"),
        ("trajectory.phase.0.name=hover", "two phases are named 'hover'"),
        (
            "trajectory.phase.0.duration=1.0",
            "expected at least the duration of its segments, 3 s, got 1 s in phase 'climb'",
        ),
        ("trajectory.phase.0.z={kind='ramp', to=inf, rate=1.0}", "finite"),
    ],
)
def test_invalid_trajectory_key_is_rejected_in_one_line(override, message):
    with pytest.raises(SceneError, match=r"\Aoverride trajectory[^\n]+\Z") as error:
        load("hover", [override])
    assert message in str(error.value)


def test_final_phase_follows_last_flight():
    up = {"name": "up", "z": {"kind": "ramp", "to": 2.0, "rate": 1.0}}
    down = {"name": "down", "z": {"kind": "ramp", "to": 0.0, "rate": 1.0}}
    again = [{**up, "name": "up again"}, {**down, "name": "down again"}, {"name": "stand", "duration": 1.0}]
    assert compile({"phase": [up, down]}).final == 1
    assert compile({"phase": [up, down, *again]}).final == 3
    assert compile({"phase": [up]}).final == 1  # never lands: no phase is the last one on the ground


@pytest.mark.parametrize(("height", "lands"), [(1.0, True), (0.6, True), (1.04, True), (1.2, False)])
def test_trajectory_that_ends_on_an_obstacle_goes_on_downwards(height, lands):
    hold = {"name": "land", "duration": 2.0}
    phases = [
        {"name": "up", "z": {"kind": "ramp", "to": 3.0, "rate": 1.0}},
        {"name": "over", "x": {"kind": "ramp", "to": 5.0, "rate": 1.0}},
        {"name": "down", "z": {"kind": "ramp", "to": height, "rate": 1.0}},
        hold,
    ]
    roof = Phases.model_validate({"phase": phases})
    result = trajectory_compiler.compile(roof, ground=lambda x, y: 1.0 if x > 4.0 else 0.0)
    stop = 3.0 + 5.0 + 3.0 - height
    later = evaluate(result.parameters, stop + 0.5, result.final)
    assert (result.final, later.final) == ((2, True) if lands else (4, False))
    assert later.position_world[2] == pytest.approx(height - 0.5 * 0.3 * lands)
    assert later.velocity_world[2] == pytest.approx(-0.3 * lands)
    assert (later.landing_speed > 0.0) is lands
    assert evaluate(result.parameters, stop - 0.5, result.final).position_world[2] == pytest.approx(height + 0.5)


def test_landing_speed_is_that_of_the_end_on_the_ground():
    up, slow = {"kind": "ramp", "to": 2.0, "rate": 1.0}, {"kind": "minimum_jerk", "to": 0.0, "duration": 3.0}
    phases = [
        {"name": "up", "z": up},
        {"name": "down", "z": {"kind": "ramp", "to": 0.0, "rate": 0.8}},
        {"name": "rest", "duration": 1.0},
        {"name": "up again", "z": up},
        {"name": "softly", "z": slow},
        {"name": "touch and go", "z": [up, {"kind": "ramp", "to": 0.0, "rate": 0.5}]},
        {"name": "dive", "z": {"kind": "ramp", "to": -12.0, "rate": 8.0}},
    ]
    speeds = trajectory_compiler.compile(Phases.model_validate({"phase": phases})).parameters.phase_landing_speed
    assert speeds == pytest.approx([-1.0, 0.8, 0.0, -1.0, 0.0, 0.5, -1.0])


NUMBER = st.floats(-3.0, 3.0)


def channel(*pieces):
    starts = np.cumsum([0.0, *(piece.duration for piece in pieces[:-1])])
    return Channel(starts, np.array([piece.row() for piece in pieces]))


@given(st.tuples(*[NUMBER] * 6), NUMBER, NUMBER, NUMBER, st.floats(0.1, 1.9))
@settings(deadline=None)
def test_channel_derivatives_match_finite_differences(polynomial, amplitude, frequency, sweep, t):
    c = channel(Piece(2.0, polynomial, amplitude, frequency, sweep))
    h = 1e-4
    (before, rate_before, _), (_, rate, acceleration), (after, rate_after, _) = (
        channel_at(c, t + d) for d in (-h, 0.0, h)
    )
    assert rate == pytest.approx((after - before) / (2.0 * h), rel=1e-5, abs=1e-3)
    assert acceleration == pytest.approx((rate_after - rate_before) / (2.0 * h), rel=1e-5, abs=1e-2)


@given(st.lists(st.floats(0.01, 5.0), min_size=1, max_size=20), st.floats(-1.0, 60.0))
@settings(deadline=None)
def test_search_matches_numpy(durations, t):
    times = np.cumsum([0.0, *durations])
    assert last_not_after(times, t) == max(np.searchsorted(times, t, side="right") - 1, 0)


def test_joint_belongs_to_later_piece():
    c = channel(Piece(1.0, (0.0, 1.0)), Piece(1.0, (5.0, -2.0)), Piece(0.0, (3.0,)))
    assert channel_at(c, 1.0) == (5.0, -2.0, 0.0)
    assert channel_at(c, np.nextafter(1.0, 0.0))[1] == 1.0
    assert channel_at(c, 2.0) == (3.0, 0.0, 0.0)
    assert channel_at(c, 99.0) == (3.0, 0.0, 0.0)


def test_reference_is_offset_by_origin():
    ramp, still = channel(Piece(9.0, (0.0, 1.0))), channel(Piece(0.0, (0.0,)))
    p = Parameters(ramp, still, still, ramp, np.array([0.0, 2.0]), np.zeros(2), np.zeros(2), (1.0, 2.0, 3.0), 0.5)
    r = evaluate(p, 4.0, 0)
    assert r.position_world == (5.0, 2.0, 3.0)
    assert r.velocity_world == (1.0, 0.0, 0.0)
    assert (r.yaw, r.yaw_rate, r.phase) == (4.5, 1.0, 1)
    assert evaluate(p, -1.0, 0) == evaluate(p, 0.0, 0)
