"""Steady flight against the plant itself, closed forms and the source's Table 8."""

import math
from pathlib import Path

import numpy as np
import pytest

from dynamics.vehicles import performance
from dynamics.vehicles.airframe import load_airframe

DRONE = load_airframe(Path(__file__).parents[3] / "scenes/vehicles/delivery_drone.toml")
WEIGHT = DRONE.mass.total * 9.80665


def test_hover():
    hover = performance.trim(DRONE)
    assert hover.tilt == pytest.approx(0.0, abs=1e-12)
    assert hover.thrust == pytest.approx(WEIGHT / 4)
    assert hover.rotor_speed * 30 / math.pi == pytest.approx(3169, abs=10)  # rpm, by hand from C_T
    assert hover.voltage == pytest.approx(hover.rotor_speed / (150 * 2 / 3 * math.pi / 30) + 0.085 * hover.current)


def test_forces_balance_at_speed():
    """Newton's law in world coordinates, with the drag written as a matrix."""
    speed = 8.0
    t = performance.trim(DRONE, speed)
    axes = np.array([[math.cos(t.tilt), math.sin(t.tilt)], [-math.sin(t.tilt), math.cos(t.tilt)]])  # world x, z of body
    v_body = axes.T @ [speed, 0.0]
    drag = axes @ (-0.5 * 1.225 * speed * np.diag([0.06, 0.16]) @ v_body)
    assert axes @ [0.0, 4 * t.thrust] + drag == pytest.approx([0.0, WEIGHT], abs=1e-9)


def test_power_has_a_minimum_at_speed_zero_or_above_and_grows_in_the_end():
    power = [performance.trim(DRONE, v).power for v in np.linspace(0.0, performance.maximum_speed(DRONE), 30)]
    assert power[-1] > 1.5 * min(power)


def test_table_8_of_the_source():
    """Hover time 19.3 min, payload 9.9 kg, ceiling 5.3 km, tilt 58.9 degrees: an online estimator's figures."""
    assert performance.hover_time(DRONE) / 60 == pytest.approx(19.3, rel=0.05)
    assert performance.maximum_payload(DRONE) == pytest.approx(9.9, rel=0.05)
    assert performance.ceiling(DRONE) == pytest.approx(5300, rel=0.06)
    assert math.degrees(performance.maximum_tilt(DRONE)) == pytest.approx(58.9, abs=3)


def test_at_the_ceiling_the_highest_thrust_is_the_weight():
    h = performance.ceiling(DRONE)
    density = 1.293 * 273 / 288 * (1 - 0.0065 * h / 288) ** 5.2561
    assert performance.maximum_thrust(DRONE, density) == pytest.approx(WEIGHT)


def test_the_highest_speed_uses_all_the_voltage():
    top = performance.maximum_speed(DRONE)
    assert performance.trim(DRONE, top).voltage == pytest.approx(44.4)
    assert performance.maximum_range(DRONE)[1] <= top


def test_without_the_parts():
    with pytest.raises(ValueError, match=r"no \[propeller\]"):
        performance.trim(DRONE.model_copy(update={"propeller": None}))
    with pytest.raises(ValueError, match=r"no \[battery\]"):
        performance.hover_time(DRONE.model_copy(update={"battery": None}))
    with pytest.raises(ValueError, match=r"no \[drag\]"):
        performance.trim(DRONE.model_copy(update={"drag": None}), 5.0)
