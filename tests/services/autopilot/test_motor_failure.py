"""Motor failure detector on a body integrated in this test: signs, fractions of thrust, detection time."""

from math import inf
from types import SimpleNamespace

import numpy as np
import pytest

from lapwing.kernels import python_function
from lapwing.services.autopilot import block
from lapwing.services.autopilot import motor_failure as watch
from lapwing.services.autopilot.commander.wakeup_conditions import BatteryThresholds
from lapwing.services.autopilot.control import Command
from lapwing.services.autopilot.controller_parameters import Airframe
from lapwing.services.autopilot.motor import Motor, thrust_at
from lapwing.services.common.ports import BatteryReading, Setpoint, StateEstimate

ARM, TICK = 0.35, 0.004
FRAME = Airframe(
    10.0, (0.27, 0.26, 0.42), (ARM, -ARM, -ARM, ARM), (ARM, ARM, -ARM, -ARM), (1.0, -1.0, 1.0, -1.0), 0.04,
    Motor(2.234e-4, 2.0 / 3.0, 150.0, 0.02), 44.4, 0.35,
)  # fmt: skip
HOVER = 0.25 * FRAME.mass * FRAME.gravity


def campaign_config(
    left,
    seconds=0.6,
    push=(0.0, 0.0),
    height=5.0,
    seed=0,
    values=None,
    impact=-1.0,
    scale=1.0,
    swing=0.0,
    lift=1.0,
    gyro_range=inf,
    drag=0.0,
    frame=FRAME,
):
    """Return the detector's state for a body whose rotors produce the fractions `left` of a varying command.

    Its angular acceleration is `scale` times that of the model, its specific force `lift` times; a torque of the
    commands about body x swings by `swing` times the hover thrust per rotor at 1 Hz. The gyroscope clips the rates at
    `gyro_range`; rates cause a torque `drag` [N m s].
    """
    p, omega = watch.build(frame, gyro_range, values or {}), np.zeros(3)
    s = python_function(watch.start)(p)
    random = np.random.default_rng(seed)
    thrust = np.full(4, HOVER)
    x, y = np.array(FRAME.rotor_x), np.array(FRAME.rotor_y)
    for k in range(round(seconds / TICK)):
        requested = HOVER * (1.0 + 0.3 * random.standard_normal(4)).clip(0.2, 2.0)
        requested = (requested + swing * HOVER * np.sign(y) * np.sin(2.0 * np.pi * k * TICK)).clip(0.0)
        upwards = 40.0 if k == round(impact / TICK) else lift * thrust.sum() / FRAME.mass - FRAME.gravity
        estimate = StateEstimate(
            omega_body=tuple(omega.clip(-gyro_range, gyro_range)), acceleration_world=(0.0, 0.0, upwards)
        )
        s = watch.step(p, s, TICK, estimate, height, tuple(requested))
        thrust += (1.0 - np.exp(-TICK / 0.02)) * (requested - thrust)
        torque = np.array([(y * left * thrust).sum() + push[0], -(x * left * thrust).sum() + push[1], 0.0])
        inertia = np.array(FRAME.inertia_body)
        torque -= drag * omega
        omega += TICK * (scale * torque - np.cross(omega, inertia * omega)) / inertia
    return s


@pytest.mark.parametrize("rotor", [1, 2, 3, 4])
@pytest.mark.parametrize(("share", "seconds"), [(0.0, 0.3), (0.5, 1.0)])
def test_rotor_with_thrust_loss_is_identified(rotor, share, seconds):
    left = np.ones(4)
    left[rotor - 1] = share
    assert campaign_config(left, seconds).failed == rotor


@pytest.mark.parametrize("rotor", [1, 3])
def test_evidence_of_lost_rotor_is_closed_form(rotor):
    """The loss seen through the filter is 1 - exp(-w t); the evidence is the integral of what is above the threshold.

    Without other torques the body turns by J omega' = -arm F from rest, and the alarm comes when
    0.7 t - (1 - exp(-w t)) / w = 0.12 s, at 0.207 s.
    """
    p, w = watch.build(FRAME, inf, {}), watch.BANDWIDTH
    s = python_function(watch.start)(p)
    for _ in range(250):
        s = watch.step(p, s, TICK, StateEstimate(), 5.0, (HOVER,) * 4)
    still = StateEstimate()
    acceleration = np.array([-p.roll[rotor - 1], -p.pitch[rotor - 1]]) * HOVER
    lifted = (0.0, 0.0, -0.25 * FRAME.gravity)
    for k in range(1, 51):
        t, share = k * TICK, 1.0 - np.exp(-k * TICK * w)
        rates = (*(acceleration * t), 0.0)
        s = watch.step(p, s, TICK, still._replace(omega_body=rates, acceleration_world=lifted), 5.0, (HOVER,) * 4)
        if t > 0.1:
            expected = (1.0 - watch.LEAST_LOSS) * t - share / w
            assert s.evidence[rotor - 1] == pytest.approx(expected, rel=0.12)
            assert max(s.evidence) == s.evidence[rotor - 1]
    assert s.failed == 0
    for k in range(51, 58):
        rates = (*(acceleration * k * TICK), 0.0)
        s = watch.step(p, s, TICK, still._replace(omega_body=rates, acceleration_world=lifted), 5.0, (HOVER,) * 4)
    assert s.failed == rotor


@pytest.mark.parametrize("scale", [0.65, 1.0, 1.5])
def test_wrong_inertia_and_thrust_are_learned(scale):
    """Commands of 1 Hz with the torque of two rotors: the former detector named a motor."""
    s = campaign_config(np.ones(4), seconds=6.0, scale=scale, swing=0.5)
    assert s.failed == 0
    p = watch.build(FRAME, inf, {})
    assert watch.effectiveness(p, s.roll) == pytest.approx(scale, rel=0.05)


def test_constant_torque_is_learned():
    """A centre of mass 2 cm from the nominal one."""
    torque = 0.02 * FRAME.mass * FRAME.gravity
    assert campaign_config(np.ones(4), seconds=6.0, push=(0.7 * torque, 0.7 * torque)).failed == 0


@pytest.mark.parametrize("lift", [0.65, 1.6])
def test_failure_is_found_with_another_mass(lift):
    """A vehicle that is lighter than the model does not sit on ground."""
    left = np.array([1.0, 1.0, 0.0, 1.0])
    assert campaign_config(np.ones(4), seconds=4.0, lift=lift).failed == 0
    assert campaign_config(left, seconds=4.0, lift=lift).failed == 3


@pytest.mark.parametrize("push", [0.1, 0.2, 0.29])
def test_no_noise_below_the_threshold_raises_an_alarm(push):
    """A constant loss below LEAST_LOSS adds no evidence, whatever its duration."""
    left = np.array([1.0 - push, 1.0, 1.0, 1.0])
    assert campaign_config(left, seconds=3.0).failed == 0


def test_disabled_detector_names_no_rotor():
    left = np.array([0.0, 1.0, 1.0, 1.0])
    assert campaign_config(left, values={"FD_ACT_EN": 1.0}).failed == 1
    assert campaign_config(left, values={"FD_ACT_EN": 0.0}).failed == 0


def test_equal_thrust_loss_is_no_motor_failure():
    for seed in range(5):
        assert campaign_config(np.ones(4), seconds=5.0, seed=seed).failed == 0
    assert campaign_config(np.full(4, 0.6), seconds=3.0).failed == 0


def test_push_along_axis_is_no_motor_failure():
    assert campaign_config(np.ones(4), push=(6.0, 0.0)).failed == 0
    assert campaign_config(np.ones(4), push=(0.0, -6.0)).failed == 0


def test_push_of_feet_on_ground_is_no_motor_failure():
    assert campaign_config(np.array([1.0, 1.0, 0.0, 1.0]), height=0.1).failed == 0


def test_detection_pauses_after_impact_and_resumes():
    left = np.array([1.0, 1.0, 0.0, 1.0])
    assert campaign_config(left, seconds=0.4, impact=0.02).failed == 0
    assert campaign_config(left, seconds=0.4).failed == 3
    assert campaign_config(left, seconds=0.9, impact=0.02).failed == 3


def test_load_is_thrust_in_flight_and_weight_on_ground():
    p = watch.build(FRAME, inf, {})
    tilted = (np.cos(0.2), np.sin(0.2), 0.0, 0.0)  # 0.4 rad about x
    thrust = 2.0 * FRAME.gravity * np.array([0.0, -np.sin(0.4), np.cos(0.4)])  # two hover thrusts [m/s^2], world
    assert watch.load(p, tilted, tuple(thrust - (0.0, 0.0, FRAME.gravity))) == pytest.approx(2.0, abs=1e-12)
    assert watch.load(p, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("gyro_range", [2.0, 4.0])
def test_lost_rotor_is_found_by_a_gyroscope_at_its_range(gyro_range):
    """The reading hides the acceleration before there is evidence enough; the loss seen last remains."""
    left = np.array([1.0, 1.0, 0.0, 1.0])
    s = campaign_config(left, seconds=0.4, gyro_range=gyro_range)
    assert s.failed == 3
    assert campaign_config(np.ones(4), seconds=3.0, gyro_range=gyro_range).failed == 0


def test_small_torque_is_no_loss_of_idling_rotor():
    """A fifth of a rotor's hover thrust is more than the thrust of a rotor that idles, but no loss of it."""
    p = watch.build(FRAME, inf, {})
    s = python_function(watch.start)(p)
    commanded, omega = (0.1 * HOVER, 2.0 * HOVER, 0.1 * HOVER, 2.0 * HOVER), np.zeros(2)
    arm = np.array([p.roll[0], p.pitch[0]]) * HOVER
    lifted = (0.0, 0.0, 0.05 * FRAME.gravity)
    for k in range(250):
        omega -= TICK * (0.2 if k > 50 else 0.0) * arm
        s = watch.step(p, s, TICK, StateEstimate(omega_body=(*omega, 0.0), acceleration_world=lifted), 5.0, commanded)
    assert s.failed == 0
    assert max(s.evidence) == 0.0


def test_known_rotational_drag_is_no_loss_and_hides_none():
    """Commands of 1 Hz with the torque of two rotors turn a vehicle whose drag balances them."""
    drag = 20.0 * FRAME.inertia_body[0]
    frame = FRAME._replace(rotational_drag=(drag, drag, drag))
    assert campaign_config(np.ones(4), seconds=5.0, swing=0.5, drag=drag, frame=frame).failed == 0
    left = np.array([1.0, 0.0, 1.0, 1.0])
    assert campaign_config(left, seconds=0.5, drag=drag, frame=frame).failed == 2


@pytest.mark.parametrize("volts", [0.8 * FRAME.voltage_max, FRAME.voltage_max])
def test_detector_expects_no_more_thrust_than_the_battery_permits(volts):
    """Two rotors at a limit that the commands exceed would seem to have lost thrust."""
    p = watch.build(FRAME, inf, {})
    law = SimpleNamespace(motor=FRAME.motor, resting_height=FRAME.resting_height)
    cells = (SimpleNamespace(value=value) for value in (law, p, BatteryThresholds(0.2, 0.1, 0.05)))
    most = python_function(thrust_at)(FRAME.motor, FRAME.voltage_max)
    command = Command((FRAME.voltage_max,) * 4, (most, 0.0, most, 0.5 * most), 0.0, 0.0, 0.0)
    start = block.StepStart(
        StateEstimate(), block.ControllerInput(), Setpoint(), block.FLYING, True, 1.0, False,
        python_function(watch.start)(p), 0, BatteryReading(0.5, volts),
    )  # fmt: skip
    detector, _ = block.block_outputs.py_func(block.Controller(*cells, TICK, 0), start, command)
    reached = (volts / FRAME.voltage_max) ** 2 * most
    assert detector.commanded == pytest.approx((reached, 0.0, reached, 0.5 * most))
