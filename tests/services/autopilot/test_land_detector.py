"""Land detector and final approach by synthetic estimates: what is contact with the ground, and what is not."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import pytest

from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import python_function
from lapwing.services.autopilot import approach, land_detector
from lapwing.services.autopilot.approach import NO_APPROACH, allowed_speed
from lapwing.services.autopilot.land_detector import (
    FLYING,
    INITIAL_LANDED_STATE,
    LANDED,
    ON_GROUND,
    SETTLING,
    LandedState,
    Parameters,
    Thresholds,
)
from lapwing.services.common.ports import Setpoint, StateEstimate

REST, G, DT = 0.35, 9.81, 0.004
HOVER = 98.1  # [N]
LIMITS = Thresholds(cut_height=0.0)
P = Parameters(LIMITS, REST, HOVER, G, slow_height=1.0, slow_speed=0.3)
CUT = P._replace(thresholds=Thresholds(cut_height=0.05))
FLIES = INITIAL_LANDED_STATE._replace(name=FLYING)
update = python_function(land_detector.update_landed_state)
approach_step = python_function(approach.update_approach)


def estimate(height=0.0, climb=0.0, acceleration=0.0):
    z = (0.0, 0.0, acceleration)
    return StateEstimate((0.0, 0.0, REST + height), NO_ROTATION, (0.0, 0.0, climb), ZERO, z)


def setpoint(height=-0.2, climb=-0.3, acceleration=0.0, landing_speed=-1.0):
    vectors = ((0.0, 0.0, REST + height), (0.0, 0.0, climb), (0.0, 0.0, acceleration))
    return Setpoint(*vectors, landing_speed=landing_speed)


@dataclass
class Detector:
    """A detector whose motors follow its ramp: lift and specific force are fractions of the weight."""

    p: Parameters = P
    state: LandedState = FLIES
    time: float = 0.0
    powers: list[float] = field(default_factory=list)

    def run(self, seconds, lift, force=1.0, climb=0.0, target=None, height=0.0):
        """Apply a commanded lift and a measured specific force for a time. Return the landed state."""
        for _ in range(round(seconds / DT)):
            e = estimate(height, climb, (force - 1.0) * G)
            thrust = lift * self.state.power * HOVER
            self.state = update(self.p, self.state, e, target or setpoint(), thrust, DT)
            self.powers.append(self.state.power)
            self.time += DT
        return self.state.name


def test_contact_ramps_the_motors_down_after_its_time():
    detector = Detector()
    before = LIMITS.hold_time + 0.02  # the filter of the force adds a part of its time constant
    assert detector.run(before, lift=0.3) == FLYING
    assert min(detector.powers) > 0.99 * SETTLING
    assert detector.run(LIMITS.ramp_time - 0.08, lift=0.3) == FLYING
    assert detector.powers == sorted(detector.powers, reverse=True)  # a ramp, no cut
    ramp = [power for power in detector.powers if power < 1.0]
    assert max(a - b for a, b in pairwise(ramp)) < 1.01 * SETTLING * DT / LIMITS.ramp_time
    assert detector.run(0.1, lift=0.3) == LANDED


@pytest.mark.parametrize(
    ("case", "motion"),
    [
        ("hover", {"lift": 1.0}),
        ("descent with a third of the mass released", {"lift": 0.67, "climb": -0.3}),
        ("free fall without thrust", {"lift": 0.0, "force": 0.0, "climb": -3.0}),
        ("the first moment of a fall", {"lift": 0.1, "force": 0.1, "climb": -0.1}),
        ("steady descent in an up-draught that carries most of the weight", {"lift": 0.2, "climb": -0.5}),
        ("steady descent at the crawl in an up-draught", {"lift": 0.3, "climb": -0.3}),
        ("fast descent, slowed down by less thrust than that of hover", {"lift": 0.5, "force": 0.5, "climb": -0.1}),
    ],
)
def test_flight_is_not_contact(case, motion):
    assert Detector().run(5.0, **motion) == FLYING, case


@pytest.mark.parametrize("ratio", [0.7, 1.5])
@pytest.mark.parametrize("climb", [-0.1, -0.3])
def test_vehicle_that_differs_from_the_model_flies_until_it_touches(ratio, climb):
    """Mass 20 % lower and thrust 20 % higher than the model's: two thirds of its thrust carry the vehicle."""
    detector = Detector()
    detector.run(4.0, lift=1.0 / ratio, climb=0.5, target=setpoint(3.0, 0.5), height=1.0)
    assert detector.run(5.0, lift=1.0 / ratio, climb=climb, target=setpoint(2.0, climb), height=1.0) == FLYING
    assert min(detector.powers) == 1.0
    assert detector.run(1.0, lift=0.4 / ratio) == LANDED


def test_only_a_descending_setpoint_lands():
    for target in (setpoint(1.0, 0.0), setpoint(-0.1, 0.2)):
        assert Detector().run(5.0, lift=0.1, target=target) == FLYING
    for target in (setpoint(0.0, 0.0), setpoint(3.0, -0.5), setpoint(2.0, 0.0, -0.5 * G)):
        assert Detector().run(5.0, lift=0.1, target=target) == LANDED


def test_bounce_starts_the_time_again_and_gives_the_thrust_back():
    detector = Detector()
    detector.run(LIMITS.hold_time + 0.2, lift=0.3)
    assert detector.state.power < 1.0
    detector.run(0.5, lift=0.3, force=0.1, climb=-0.1)  # in the air again, longer than the contact
    assert detector.state.power == 1.0
    assert detector.run(LIMITS.hold_time, lift=0.3) == FLYING
    assert detector.run(LIMITS.ramp_time + 0.1, lift=0.3) == LANDED


def test_fall_ends_a_ramp():
    """In an up-draught of the speed of fall without thrust, only the motion tells."""
    detector = Detector()
    detector.run(LIMITS.hold_time + 0.2, lift=0.3)
    assert detector.state.power < 1.0
    detector.run(0.35, lift=0.3, climb=-2.1)
    assert detector.state.power == 1.0


def test_impact_delays_landing_without_ending_it():
    """On its first foot on a slope: an estimate wrong by 1.5 m/s, a rebound, thrust against the estimated fall."""
    detector = Detector()
    detector.run(LIMITS.hold_time + 0.1, lift=0.6)
    detector.run(0.1, lift=0.3, climb=-1.5)
    detector.run(0.1, lift=0.9, force=0.8, climb=-0.5)
    assert detector.run(LIMITS.ramp_time + 0.1, lift=0.8, climb=-0.45) == LANDED


def test_wrong_height_does_not_matter():
    for height in (-2.0, 0.5, 8.0):
        assert Detector().run(2.0, lift=0.2, height=height) == LANDED


def test_no_contact_without_gravity():
    weightless = P._replace(gravity=0.0, hover_thrust=0.0)
    assert Detector(weightless).run(5.0, lift=0.0) == FLYING


def state_after(stage, height, requested, speed=0.0, setpoint_speed=0.0, ticks=1, p=CUT):
    state = INITIAL_LANDED_STATE._replace(name=stage)
    for _ in range(ticks):
        state = update(p, state, estimate(height, speed), setpoint(requested, setpoint_speed), HOVER, DT)
    return state.name


@pytest.mark.parametrize("p", [P, CUT])
def test_motors_rest_until_setpoint_leaves_ground(p):
    assert state_after(ON_GROUND, 0.0, 0.0, p=p) == ON_GROUND
    assert state_after(ON_GROUND, 0.0, 0.0, setpoint_speed=1.0, p=p) == FLYING
    assert state_after(ON_GROUND, 0.0, 10.0, p=p) == FLYING


@pytest.mark.parametrize("p", [P, CUT])
def test_landed_lasts_until_mission_climbs_again(p):
    assert state_after(LANDED, 0.0, 0.0, p=p) == LANDED
    assert state_after(LANDED, 0.0, 0.04, setpoint_speed=-1.0, p=p) == LANDED
    assert state_after(LANDED, 5.0, 10.0, p=p) == LANDED  # a constant setpoint in the air does not start the motors
    assert state_after(LANDED, 0.0, 0.04, setpoint_speed=1.0, p=p) == LANDED
    assert state_after(LANDED, 0.0, 0.06, setpoint_speed=1.0, p=p) == FLYING


def test_cut_height_stops_the_motors_only_to_land():
    assert state_after(FLYING, 0.01, 0.01, setpoint_speed=1.0) == FLYING  # still taking off
    assert state_after(FLYING, 0.01, 5.0) == FLYING
    assert state_after(FLYING, 0.051, 0.0, speed=-1.0, setpoint_speed=-1.0) == FLYING
    assert state_after(FLYING, 0.049, 0.0, speed=-1.0, setpoint_speed=-1.0) == LANDED


def test_cut_height_with_wrong_height_estimate():
    assert state_after(FLYING, 0.2, 0.0, speed=0.01, ticks=499) == FLYING
    assert state_after(FLYING, 0.2, 0.0, speed=0.01, ticks=502) == LANDED
    assert state_after(FLYING, 0.2, 0.0, speed=-0.3, ticks=2000) == FLYING  # still sinking
    assert state_after(FLYING, 0.8, 0.0, speed=0.01, ticks=2000) == FLYING  # too high to be an error


def descend(path, seconds, drift=0.0):
    """Return height, speed down and time of an approach's setpoints along a path: height, climb rate, landing speed."""
    state, rows = NO_APPROACH, []
    for k in range(round(seconds / DT)):
        height, climb, landing_speed = path(k * DT)
        followed = rows[-1][0] if rows else height
        state, s = approach_step(P, state, setpoint(height, climb, 0.0, landing_speed), REST + followed + drift, DT)
        rows.append((s.position_world[2] - REST, -s.velocity_world[2], k * DT))
    return rows


def ramp(t, speed=1.0, start=5.0):
    return (start - speed * t, -speed, speed) if speed * t < start else (0.0, 0.0, 0.0)


def test_ramp_brakes_to_the_slow_speed_at_its_height():
    """v^2 = v0^2 + 2 a (h - h0): the whole way takes the time of three parts with constant acceleration."""
    rows = descend(ramp, 9.0)
    assert all(speed <= python_function(allowed_speed)(P, h) + 0.02 for h, speed, _ in rows)
    slow = [speed for h, speed, _ in rows if 0.0 < h < P.slow_height]
    assert max(slow) - 0.3 < 1.01 * approach.BRAKING * DT
    assert min(slow) == pytest.approx(0.3)
    brake = (1.0 - 0.3**2) / (2.0 * approach.BRAKING)
    expected = (5.0 - 1.0 - brake) + (1.0 - 0.3) / approach.BRAKING + 1.0 / 0.3
    assert next(t for h, _, t in rows if h <= 0.0) == pytest.approx(expected, abs=0.02)
    steps = [abs(a[0] - b[0] - DT * b[1]) for a, b in pairwise(rows)]
    assert max(steps) < 1e-5  # position and speed fit, without jumps


def test_slow_trajectory_is_followed_and_continued_below_ground():
    rows = descend(lambda t: ramp(t, 0.2, 1.0), 8.0)
    assert all(h == pytest.approx(1.0 - 0.2 * t) and speed == 0.2 for h, speed, t in rows if t < 4.99)
    assert rows[-1][0] == pytest.approx(-0.3 * 3.0, abs=0.1)


def test_phase_that_ends_in_the_air_is_followed_exactly():
    rows = descend(lambda t: (5.0 - t, -1.0, -1.0), 4.9)
    assert all(h == pytest.approx(5.0 - t) for h, _, t in rows)


def test_setpoint_does_not_run_away_from_a_vehicle_that_cannot_follow():
    state, s = NO_APPROACH, setpoint(0.0, 0.0, 0.0, 0.0)
    for _ in range(5000):
        state, result = approach_step(P, state, s, REST + 0.1, DT)
    assert result.position_world[2] == pytest.approx(REST + 0.1 - approach.DEEPEST)


def test_trajectory_that_climbs_again_takes_over_where_the_approach_is():
    def touch_and_go(t):
        return (2.0 - t, -1.0, 1.0) if t < 2.0 else (t - 2.0, 1.0, -1.0)

    rows = descend(touch_and_go, 4.0)
    assert max(abs(a[0] - b[0]) for a, b in pairwise(rows)) < 1.5 * DT
    assert rows[-1][0] == pytest.approx(2.0, abs=0.02)


def test_allowed_speed_is_that_of_constant_braking():
    for height in (0.0, 1.0, 1.5, 4.0):
        speed = python_function(allowed_speed)(P, height)
        assert speed == pytest.approx(math.sqrt(0.09 + max(0.0, height - 1.0)))  # 2 BRAKING = 1 m/s^2
