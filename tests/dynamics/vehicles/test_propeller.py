"""Propeller coefficients against the formulas of the source."""

import math
from pathlib import Path

import pytest

from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.airframe_tables import Propeller
from lapwing.dynamics.vehicles.propeller import drag_coefficients, thrust_coefficient, torque_coefficient

PROPELLER = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml").propeller


def test_coefficients_follow_source_formulas():
    a, k, angle = 5.0, 6.11, 0.85 * math.atan(7.4 / (math.pi * 22.0))
    thrust = 0.25 * math.pi**3 * 0.75 * 0.5**2 * 2 * k * angle / (math.pi * a + k)
    drag = 0.015 + math.pi * a * k**2 / 0.83 * angle**2 / (math.pi * a + k) ** 2
    torque = math.pi**2 * drag * 0.75 * 0.5**2 * 2**2 / (8 * a)
    assert thrust_coefficient(PROPELLER) == pytest.approx(thrust, rel=1e-14)
    assert sum(drag_coefficients(PROPELLER)) == pytest.approx(drag, rel=1e-14)
    assert torque_coefficient(PROPELLER) == pytest.approx(torque, rel=1e-14)


def test_coefficients_have_plausible_magnitudes():
    assert thrust_coefficient(PROPELLER) == pytest.approx(0.0738, abs=5e-5)
    assert torque_coefficient(PROPELLER) == pytest.approx(0.0050, abs=5e-5)
    highest = 44.4 * 150 * 2 / 3 / 60  # [1/s]
    assert 1.225 * thrust_coefficient(PROPELLER) * highest**2 * PROPELLER.diameter**4 == pytest.approx(48.0, abs=0.5)


def test_flat_blade_has_profile_drag_only():
    flat = Propeller(**{**PROPELLER.model_dump(), "pitch": 1e-6})
    assert thrust_coefficient(flat) == pytest.approx(0.0, abs=1e-6)
    assert drag_coefficients(flat) == (0.015, pytest.approx(0.0, abs=1e-12))


def test_shaft_power_is_above_ideal_induced_power():
    """Figure of merit of a hovering rotor, C_T^1.5 / (sqrt(2) C_P) in rotor units, lies between 0 and 1."""
    thrust, torque = thrust_coefficient(PROPELLER), torque_coefficient(PROPELLER)
    merit = math.sqrt(2.0 / math.pi) * thrust**1.5 / (2.0 * math.pi * torque)
    assert 0.3 < merit < 1.0
