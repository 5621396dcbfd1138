from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.services.autopilot.interface import Estimate, Setpoint
from lapwing.services.autopilot.land_detector import (
    FLYING,
    INITIAL_STAGE,
    LANDED,
    ON_GROUND,
    LandedState,
    advance_stage,
)

REST = 0.35
ZERO = (0.0, 0.0, 0.0)


def after(stage, height, asked, speed=0.0, asked_speed=0.0, ticks=1):
    estimate = Estimate((0.0, 0.0, REST + height), NO_ROTATION, (0.0, 0.0, speed), ZERO)
    setpoint = Setpoint((0.0, 0.0, REST + asked), (0.0, 0.0, asked_speed), ZERO, 0.0, 0.0)
    for _ in range(ticks):
        stage = advance_stage(stage, REST, estimate, setpoint, 0.004)
    return stage.name


def test_motors_rest_until_the_setpoint_leaves_the_ground():
    assert after(INITIAL_STAGE, 0.0, 0.0) == ON_GROUND
    assert after(INITIAL_STAGE, 0.0, 0.0, asked_speed=1.0) == FLYING
    assert after(INITIAL_STAGE, 0.0, 10.0) == FLYING


def test_motors_stop_below_five_centimetres_only_when_asked_to_land():
    assert after(LandedState(FLYING, 0.0), 0.01, 0.01, asked_speed=1.0) == FLYING  # still taking off
    assert after(LandedState(FLYING, 0.0), 0.01, 5.0) == FLYING
    assert after(LandedState(FLYING, 0.0), 0.051, 0.0, speed=-1.0, asked_speed=-1.0) == FLYING
    assert after(LandedState(FLYING, 0.0), 0.049, 0.0, speed=-1.0, asked_speed=-1.0) == LANDED


def test_landed_lasts_until_the_mission_climbs_again():
    assert after(LandedState(LANDED, 0.0), 0.0, 0.0) == LANDED
    assert after(LandedState(LANDED, 0.0), 0.0, 0.04, asked_speed=-1.0) == LANDED
    assert (
        after(LandedState(LANDED, 0.0), 5.0, 10.0) == LANDED
    )  # a setpoint that stands in the air is none to start from
    assert after(LandedState(LANDED, 0.0), 0.0, 0.04, asked_speed=1.0) == LANDED
    assert after(LandedState(LANDED, 0.0), 0.0, 0.06, asked_speed=1.0) == FLYING


def test_a_vehicle_that_stands_stops_although_its_height_is_estimated_wrong():
    assert after(LandedState(FLYING, 0.0), 0.2, 0.0, speed=0.01, ticks=499) == FLYING
    assert after(LandedState(FLYING, 0.0), 0.2, 0.0, speed=0.01, ticks=502) == LANDED
    assert after(LandedState(FLYING, 0.0), 0.2, 0.0, speed=-0.3, ticks=2000) == FLYING  # still sinking
    assert after(LandedState(FLYING, 0.0), 0.8, 0.0, speed=0.01, ticks=2000) == FLYING  # too high to be an error
