"""Motor failure detector on a body integrated in this test: signs, fractions of thrust, detection time."""

import numpy as np
import pytest

from lapwing.kernels import python_function
from lapwing.services.autopilot import motor_failure as watch
from lapwing.services.autopilot.controller_parameters import Airframe
from lapwing.services.autopilot.motor import Motor
from lapwing.services.common.ports import StateEstimate

ARM, TICK = 0.35, 0.004
FRAME = Airframe(
    10.0, (0.27, 0.26, 0.42), (ARM, -ARM, -ARM, ARM), (ARM, ARM, -ARM, -ARM), (1.0, -1.0, 1.0, -1.0), 0.04,
    Motor(2.234e-4, 2.0 / 3.0, 150.0, 0.02), 44.4, 0.35,
)  # fmt: skip
HOVER = 0.25 * FRAME.mass * FRAME.gravity


def campaign_setup(left, seconds=0.6, push=(0.0, 0.0), height=5.0, seed=0, values=None, impact=-1.0):
    """Return the detector's state for a body whose rotors produce the fractions `left` of a varying command."""
    p, omega = watch.build(FRAME, values or {}), np.zeros(3)
    s = python_function(watch.start)(p)
    random = np.random.default_rng(seed)
    thrust = np.full(4, HOVER)
    x, y = np.array(FRAME.rotor_x), np.array(FRAME.rotor_y)
    for k in range(round(seconds / TICK)):
        requested = HOVER * (1.0 + 0.3 * random.standard_normal(4)).clip(0.2, 2.0)
        upwards = 40.0 if k == round(impact / TICK) else 0.0
        estimate = StateEstimate(omega_body=tuple(omega), acceleration_world=(0.0, 0.0, upwards))
        s = watch.step(p, s, TICK, estimate, height, tuple(requested))
        thrust += (1.0 - np.exp(-TICK / 0.02)) * (requested - thrust)
        torque = np.array([(y * left * thrust).sum() + push[0], -(x * left * thrust).sum() + push[1], 0.0])
        inertia = np.array(FRAME.inertia_body)
        omega += TICK * (torque - np.cross(omega, inertia * omega)) / inertia
    return s


@pytest.mark.parametrize("rotor", [1, 2, 3, 4])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_rotor_with_thrust_loss_is_identified(rotor, share):
    left = np.ones(4)
    left[rotor - 1] = share
    assert campaign_setup(left).failed == rotor


def test_disabled_detector_names_no_rotor():
    left = np.array([0.0, 1.0, 1.0, 1.0])
    assert campaign_setup(left, values={"FD_ACT_EN": 1.0}).failed == 1
    assert campaign_setup(left, values={"FD_ACT_EN": 0.0}).failed == 0


def test_equal_thrust_loss_is_no_motor_failure():
    for seed in range(5):
        assert campaign_setup(np.ones(4), seconds=5.0, seed=seed).failed == 0
    assert campaign_setup(np.full(4, 0.6)).failed == 0


def test_push_along_axis_is_no_motor_failure():
    assert campaign_setup(np.ones(4), push=(6.0, 0.0)).failed == 0
    assert campaign_setup(np.ones(4), push=(0.0, -6.0)).failed == 0


def test_push_of_feet_on_ground_is_no_motor_failure():
    assert campaign_setup(np.array([1.0, 1.0, 0.0, 1.0]), height=0.1).failed == 0


def test_detection_pauses_after_impact_and_resumes():
    left = np.array([1.0, 1.0, 0.0, 1.0])
    assert campaign_setup(left, seconds=0.4, impact=0.02).failed == 0
    assert campaign_setup(left, seconds=0.4).failed == 3
    assert campaign_setup(left, seconds=0.9, impact=0.02).failed == 3


def test_excess_is_zero_in_flight_and_weight_on_ground():
    p = watch.build(FRAME, {})
    half = (0.5 * HOVER) ** 0.5
    tilted = (np.cos(0.2), np.sin(0.2), 0.0, 0.0)  # 0.4 rad about x
    thrust = 2.0 * FRAME.gravity * np.array([0.0, -np.sin(0.4), np.cos(0.4)])  # two hover thrusts [m/s^2], world
    flying = watch.excess(p, ((2.0 * HOVER) ** 0.5,) * 4, tilted, tuple(thrust - (0.0, 0.0, FRAME.gravity)))
    assert flying == pytest.approx(0.0, abs=1e-12)
    assert watch.excess(p, (half,) * 4, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) == pytest.approx(0.5, abs=1e-12)


def test_disturbance_is_missing_angular_acceleration():
    left = np.array([0.8, 1.0, 1.0, 1.0])  # too small a loss
    s = campaign_setup(left)
    assert s.failed == 0
    expected = -0.2 * HOVER * ARM / FRAME.inertia_body[0], 0.2 * HOVER * ARM / FRAME.inertia_body[1]
    assert s.disturbance == pytest.approx(expected, rel=0.35)
