from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.services.autopilot.land_detector import (
    FLYING,
    INITIAL_LANDED_STATE,
    LANDED,
    ON_GROUND,
    LandedState,
    update_landed_state,
)
from lapwing.services.common.ports import Setpoint, StateEstimate

REST = 0.35
ZERO = (0.0, 0.0, 0.0)


def state_after(stage, height, requested, speed=0.0, setpoint_speed=0.0, ticks=1):
    estimate = StateEstimate((0.0, 0.0, REST + height), NO_ROTATION, (0.0, 0.0, speed), ZERO)
    setpoint = Setpoint((0.0, 0.0, REST + requested), (0.0, 0.0, setpoint_speed), ZERO, 0.0, 0.0)
    for _ in range(ticks):
        stage = update_landed_state(stage, REST, estimate, setpoint, 0.004)
    return stage.name


def test_motors_rest_until_setpoint_leaves_ground():
    assert state_after(INITIAL_LANDED_STATE, 0.0, 0.0) == ON_GROUND
    assert state_after(INITIAL_LANDED_STATE, 0.0, 0.0, setpoint_speed=1.0) == FLYING
    assert state_after(INITIAL_LANDED_STATE, 0.0, 10.0) == FLYING


def test_motors_stop_below_cut_height_only_to_land():
    assert state_after(LandedState(FLYING, 0.0), 0.01, 0.01, setpoint_speed=1.0) == FLYING  # still taking off
    assert state_after(LandedState(FLYING, 0.0), 0.01, 5.0) == FLYING
    assert state_after(LandedState(FLYING, 0.0), 0.051, 0.0, speed=-1.0, setpoint_speed=-1.0) == FLYING
    assert state_after(LandedState(FLYING, 0.0), 0.049, 0.0, speed=-1.0, setpoint_speed=-1.0) == LANDED


def test_landed_lasts_until_mission_climbs_again():
    assert state_after(LandedState(LANDED, 0.0), 0.0, 0.0) == LANDED
    assert state_after(LandedState(LANDED, 0.0), 0.0, 0.04, setpoint_speed=-1.0) == LANDED
    assert (
        state_after(LandedState(LANDED, 0.0), 5.0, 10.0) == LANDED
    )  # a constant setpoint in the air does not start the motors
    assert state_after(LandedState(LANDED, 0.0), 0.0, 0.04, setpoint_speed=1.0) == LANDED
    assert state_after(LandedState(LANDED, 0.0), 0.0, 0.06, setpoint_speed=1.0) == FLYING


def test_landed_vehicle_stops_with_wrong_height_estimate():
    assert state_after(LandedState(FLYING, 0.0), 0.2, 0.0, speed=0.01, ticks=499) == FLYING
    assert state_after(LandedState(FLYING, 0.0), 0.2, 0.0, speed=0.01, ticks=502) == LANDED
    assert state_after(LandedState(FLYING, 0.0), 0.2, 0.0, speed=-0.3, ticks=2000) == FLYING  # still sinking
    assert state_after(LandedState(FLYING, 0.0), 0.8, 0.0, speed=0.01, ticks=2000) == FLYING  # too high to be an error
