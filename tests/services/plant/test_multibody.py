"""Plant model `multibody`: scene tables, propeller failures, and the climb of the rigid-body model."""

import math
from pathlib import Path

import pytest

from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.scene import SceneError
from lapwing.messages.topics import BODIES, TRUTH
from lapwing.services.common.ports import MotorCommand
from lapwing.services.scene_resolver import load
from tests.combinations import rest_nightly
from tests.cosim.service_harness import Alone

pytestmark = pytest.mark.long

MISSION = Path(__file__).parents[3] / "lapwing/scenes/delivery_mission.toml"
FLOWN = "vehicle.model=multibody"
CALM = ["effects.random_wind_force.mean=[0.0, 0.0, 0.0]", "effects.random_wind_force.sigma=0.0"]


def full_voltage(tick):
    return (44.4,) * 4


def lift_off(overrides, ticks=50, volts=full_voltage):
    """Return (truth, bodies) after ticks of 4 ms up to 0.2 s at these voltages, by default the maximum."""
    plant = Alone(load(MISSION, overrides), "plant")
    for tick in range(ticks + 1):
        plant.step(actuators=MotorCommand(volts(tick), True, (0.0,) * 4, (0.0,) * 3))
    return plant.message(TRUTH), plant.message(BODIES)


def test_multibody_climb_equals_reduced_model():
    one, _ = lift_off(CALM)
    several, bodies = lift_off([FLOWN, *CALM])
    assert several.pose.position.z == pytest.approx(one.pose.position.z, abs=1e-6)
    assert several.rotor_speed == pytest.approx(one.rotor_speed, rel=1e-3)
    assert list(bodies.name) == ["chassis", "propeller1", "propeller2", "propeller3", "propeller4"]
    # hinges lift the chassis with the thrust less the weight and inertia of the propellers
    assert sum(f.z for f in bodies.force[1:]) == pytest.approx(-bodies.force[0].z)
    assert 0.99 * sum(several.rotor_thrust) < bodies.force[0].z < sum(several.rotor_thrust)


def event(time, propeller, becomes):
    return f'{{time={time}, propeller={propeller}, failure="{becomes}"}}'


BROKEN = f"multibody.event=[{event(0.1, 1, 'locked')}, {event(0.1, 2, 'free')}, {event(0.15, 3, 'torn_off')}]"


def test_propeller_failures_in_flight():
    """At 0.1 s the first locks and the second is freed, at 0.15 s the third is torn off; the fourth keeps running."""
    flight = [FLOWN, BROKEN, *CALM]
    just_before, _ = lift_off(flight, ticks=25)
    at_once, _ = lift_off(flight, ticks=26)
    later, bodies = lift_off(flight, ticks=45)
    assert min(just_before.rotor_speed) > 100.0
    assert at_once.rotor_speed[0] == pytest.approx(0.0, abs=1e-9)
    assert at_once.rotor_speed[1] == pytest.approx(just_before.rotor_speed[1], rel=0.1)
    assert later.rotor_speed[0] == pytest.approx(0.0, abs=1e-9)
    assert 0.0 < later.rotor_speed[1] < just_before.rotor_speed[1]
    assert later.rotor_speed[2] == later.rotor_thrust[2] == 0.0
    assert later.rotor_speed[3] > just_before.rotor_speed[3]
    assert bodies.force[3].z == bodies.torque[3].z == 0.0
    assert bodies.torque[2].z == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("coordinates", rest_nightly("se3", "euler"))
def test_failure_between_ticks_acts_at_its_own_time(coordinates):
    """A failure half a tick later changes half of the impulse; two failures in one tick act in sequence."""
    failures = [[event(time, 1, "locked"), event(0.103, 2, "torn_off")] for time in (0.1, 0.102, 0.104)]
    failures[2].reverse()
    flight = [
        lift_off([FLOWN, *CALM, f"multibody.coordinates={coordinates}", f"multibody.event=[{', '.join(f)}]"], ticks=26)[
            0
        ]
        for f in failures
    ]
    early, between, late = (f.angular_velocity.x for f in flight)
    assert abs(late - early) > 1e-3
    assert between == pytest.approx(0.5 * (early + late), abs=0.05 * abs(late - early))
    assert [f.rotor_speed[0] > 1.0 for f in flight] == [False, False, True]
    assert [f.rotor_speed[1] for f in flight] == [0.0, 0.0, 0.0]


def test_divergence_of_euler_angles_names_cause():
    with pytest.raises(LockStepError, match=r"not finite at t = 0.004 s: .*; use a smaller step than 0.001 s"):
        lift_off([FLOWN, "multibody.coordinates=euler", *CALM], 1, lambda tick: (math.nan,) * 4)


WRONG = {
    "no such propeller": (
        [FLOWN],
        f"multibody.event=[{event(1.0, 5, 'free')}]",
        "multibody.event.0.propeller: expected a whole number at least 1 and at most 4, got 5",
    ),
    "an event after the end": (
        [FLOWN, "run.duration=2"],
        f"multibody.event=[{event(2.5, 1, 'free')}]",
        "multibody.event.0.time: expected a time within run.duration = 2 s, got 2.5",
    ),
    "an event before the start": (
        [FLOWN],
        f"multibody.event=[{event(-1.0, 1, 'free')}]",
        "multibody.event.0.time: expected a number at least 0 [s], got -1",
    ),
    "an unknown fate": (
        [FLOWN],
        f"multibody.event=[{event(1.0, 1, 'bent')}]",
        "multibody.event.0.failure: expected 'locked', 'free' or 'torn_off', got 'bent'",
    ),
    "what is gone already": (
        [FLOWN],
        f"multibody.event=[{event(2.0, 1, 'free')}, {event(1.0, 1, 'torn_off')}]",
        "multibody.event.0.propeller: propeller 1 is torn off at 1 s and cannot fail again",
    ),
    "the reduced model": (
        [],
        f"multibody.event=[{event(1.0, 1, 'free')}]",
        'multibody: the model rigid_body has no such table; set vehicle.model = "multibody"',
    ),
    "an unused table": (
        [],
        "multibody.drive=speed",
        'the model rigid_body has no such table; set vehicle.model = "mul',
    ),
    "unknown coordinates": ([FLOWN], "multibody.coordinates=so3", "multibody.coordinates: expected"),
    "a long step": (
        [FLOWN],
        "solver.step=0.004",
        "solver.step: propellers turn at up to 465 rad/s; expected at most 0.001 s",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_invalid_scene_error_names_key(name):
    before, override, message = WRONG[name]
    with pytest.raises(SceneError) as error:
        load(MISSION, [*before, override])
    assert message in str(error.value)
