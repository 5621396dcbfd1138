import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.trajectory.mission import compile
from services.trajectory.piece import channel_at, evaluate

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


def test_delivery_mission_is_at_each_corner_when_it_should_be():
    parameters, phases, duration, _ = compile({"phase": DELIVERY}, (0.0, 0.0, 0.35))
    assert phases == tuple(phase["name"] for phase in DELIVERY)
    assert duration == pytest.approx(60.0 + TURN, abs=1e-12)
    corners = {0.0: (0, 0, 0), 10.0: (0, 0, 10), 15.0: (0, 0, 10), 25.0: (10, 0, 10), 40.0: (10, 10, 10)}
    for t, (x, y, z) in corners.items():
        assert evaluate(parameters, t).position_world == (x, y, z + 0.35)
    for k, t in enumerate((0.0, 10.0, 15.0, 25.0, 30.0, 40.0, 45.0, 45.0 + TURN, 50.0 + TURN)):
        assert evaluate(parameters, t).phase == k
        assert evaluate(parameters, t + 1e-6).phase == k
    assert evaluate(parameters, 4.0).velocity_world == (0.0, 0.0, 1.0)
    assert evaluate(parameters, 12.0).velocity_world == (0.0, 0.0, 0.0)
    assert evaluate(parameters, 46.0).yaw_rate == pytest.approx(0.3, rel=1e-15)
    end = evaluate(parameters, duration)
    assert (end.position_world, end.yaw, end.velocity_world) == ((10.0, 10.0, 0.35), math.pi / 2, (0.0, 0.0, 0.0))


def test_a_phase_lasts_as_long_as_its_longest_channel_and_the_others_hold():
    phase = {
        "name": "both",
        "x": {"kind": "ramp", "to": 1.0, "duration": 2.0},
        "y": [RAMP, {"kind": "hold", "duration": 3.0}],
    }
    parameters, _, duration, _ = compile({"phase": [phase]})
    assert duration == 13.0
    assert evaluate(parameters, 5.0).position_world == (1.0, 5.0, 0.0)
    assert evaluate(parameters, 12.0).velocity_world == (0.0, 0.0, 0.0)


def test_a_step_is_a_jump_that_takes_no_time():
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
def test_everything_but_a_step_joins_continuously(pairs):
    phases = [{"name": str(k), "x": list(pair), "duration": 7.0} for k, pair in enumerate(pairs)]
    parameters, *_ = compile({"phase": phases})
    assert all(np.diff(parameters.x.start) > 0.0)
    for start in parameters.x.start[1:]:
        assert channel_at(parameters.x, start)[0] == pytest.approx(channel_at(parameters.x, start - 1e-9)[0], abs=1e-6)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({}, "trajectory.phase: Field required"),
        ({"phase": []}, "at least 1"),
        (
            {"phase": [{"name": "a", "z": {"kind": "rump"}}]},
            "trajectory.phase.0.z: unknown kind of segment 'rump'; choose one of chirp, hold",
        ),
        ({"phase": [{"name": "a", "z": 3.0}]}, "a segment is a table with a kind"),
        (
            {"phase": [{"name": "a", "z": {"kind": "hold", "duration": -1.0}}]},
            "trajectory.phase.0.z.duration: Input should be greater than 0",
        ),
        ({"phase": [{"name": "a", "z": {"kind": "ramp", "to": 1.0}}]}, "either rate or duration"),
        ({"phase": [{"name": "a", "q": 1.0}]}, "trajectory.phase.0.q"),
        ({"phase": [{"name": "a"}, {"name": "a"}]}, "two phases are named 'a'"),
        (
            {"phase": [{"name": "a", "duration": 1.0, "z": RAMP}]},
            "phase 'a': its segments last 10 s, longer than its duration 1 s",
        ),
        ({"phase": [{"name": "a", "z": {"kind": "ramp", "to": math.inf, "rate": 1.0}}]}, "finite"),
        (
            {"phase": [{"name": "a", "z": {"kind": "table", "file": "none.csv"}}]},
            "phase 'a', z: table none.csv: cannot be read",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(spec, message):
    with pytest.raises(ValueError, match=r"\A[^\n]+\Z") as error:
        compile(spec, folder=Path())
    assert message in str(error.value)


def test_the_last_landing_is_known():
    up = {"name": "up", "z": {"kind": "ramp", "to": 2.0, "rate": 1.0}}
    down = {"name": "down", "z": {"kind": "ramp", "to": 0.0, "rate": 1.0}}
    again = [{**up, "name": "up again"}, {**down, "name": "down again"}, {"name": "stand", "duration": 1.0}]
    assert compile({"phase": [up, down]}).final == 1
    assert compile({"phase": [up, down, *again]}).final == 3
    assert compile({"phase": [up]}).final == 1  # never lands: no phase is the last one on the ground
