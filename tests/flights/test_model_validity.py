"""Validity warnings of computed descents, of motor currents and of a path beyond a terrain grid."""

import math

import numpy as np
import pytest
import synthetic_flights

import lapwing
from lapwing.flights.model_validity import in_vortex_ring

SCENE = {"airframe": {"propeller": {"diameter": 0.5}, "motor": {"max_voltage": 40.0}}}
HOVER = math.sqrt(40.0 / (2 * 1.2 * 4 * math.pi * 0.25**2))  # [m/s] four rotors of 10 N, 0.5 m


def flown(velocity, turned=synthetic_flights.LEVEL, scene=SCENE, wind=(0.0, 0.0, 0.0), position=(0.0, 0.0, 50.0)):
    truth = {
        "pose.position": position,
        "pose.orientation": turned,
        "velocity": velocity,
        "wind": wind,
        "air_density": 1.2,
        "rotor_thrust": (10.0,) * 4,
        "motor_voltage": (20.0,) * 4,
        "rotor_speed": (150.0,) * 4,
        "ground_contact": False,
    }
    return synthetic_flights.flight(
        400,
        100,
        scene=scene,
        ground_truth=truth,
        status={"armed": True, "landed": False, "finished": False, "mode": "mission", "phase": ""},
        actuators={"armed": True},
    )


def ring(*velocity, **how):
    return bool(in_vortex_ring(flown(velocity, **how).truth, 0.5).all())


def test_vortex_ring_limits_in_induced_velocities():
    assert [ring(0.0, 0.0, -f * HOVER) for f in (0.0, 0.45, 0.55, 1.0, 1.45, 1.55)] == [0, 0, 1, 1, 1, 0]
    assert not ring(1.1 * HOVER, 0.0, -HOVER)
    assert ring(0.9 * HOVER, 0.0, -HOVER)


def test_vortex_ring_depends_on_air_along_rotor_axis():
    assert ring(0.0, 0.0, 0.0, wind=(0.0, 0.0, HOVER))
    quarter = math.sqrt(0.5)
    assert ring(-HOVER, 0.0, 0.0, turned=(0.0, quarter, 0.0, quarter))  # nose down: body z is world x
    assert not ring(HOVER, 0.0, 0.0, turned=(0.0, quarter, 0.0, quarter))


def test_vortex_ring_is_one_warning_with_its_share():
    t = np.arange(400) / 100
    inside = ((t >= 1.0) & (t < 2.0)) | ((t >= 3.2) & (t < 3.7))
    down = np.where(inside, -HOVER, 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    (warning,) = [event for event in flown(down).events if event.kind == "warning"]
    assert warning.time == 1.0
    assert "vortex ring state for 1.5 s (2 times), 38 % of the time in the air" in warning.text


def test_short_vortex_ring_is_not_reported():
    t = np.arange(400) / 100
    down = np.where((t >= 1.0) & (t < 1.3), -HOVER, 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    assert not [event for event in flown(down).events if event.kind == "warning"]


@pytest.mark.parametrize(("distance", "count"), [(99e3, 0), (101e3, 1)])
def test_flight_far_from_home_is_reported(distance, count):
    flight = flown((1.0, 0.0, 0.0), position=(0.6 * distance, -0.8 * distance, 50.0))
    warnings = [event.text for event in flight.events if event.kind == "warning"]
    assert len(warnings) == count
    assert all("more than 100 km from home" in warning for warning in warnings)


def test_flight_beyond_terrain_grid_is_reported():
    grid = {"heights": [[0.0, 1.0, 2.0], [0.0, 1.0, 2.0]], "corner": [-1.0, -2.0], "spacing": 2.0}
    x = np.linspace(0.0, 4.0, 400)
    walk = np.column_stack([x, 0 * x - 1.0, 0 * x + 9.0])
    scene = {**SCENE, "environment": {"terrain": {"grid": grid}}}
    (warning,) = [e for e in flown((1.0, 0.0, 0.0), scene=scene, position=walk).events if e.kind == "warning"]
    assert round(warning.time, 1) == 3.0
    assert "beyond the edge of the terrain grid for 1.0 s" in warning.text


MOTOR = {"max_voltage": 40.0, "speed_constant": 150.0, "gear_ratio": 2 / 3, "resistance": 0.085, "peak_current": 26.5}


@pytest.mark.parametrize(("peak", "effects", "count"), [(66.0, {}, 1), (67.0, {}, 0), (66.0, {"dc_motor": {}}, 0)])
def test_unlimited_motor_current_is_reported(peak, effects, count):
    """(20 V - 150 rad/s K) / 0.085 ohm with K = 60 / (2 pi 150 rpm/V 2/3) is 66.8 A."""
    scene = {"airframe": {"motor": {**MOTOR, "peak_current": peak}}, "effects": effects}
    warnings = [event for event in flown((0.0, 0.0, 0.0), scene=scene).events if event.kind == "warning"]
    assert len(warnings) == count
    text = "motors take up to 66.8 A, rated 66 A; add effect dc_motor"
    assert all(warning.text == text for warning in warnings)


@pytest.mark.long
def test_run_of_paper_mission_names_unlimited_current():
    """Mission of the paper as flown: 311 A, as found by hand from voltages and speeds."""
    flight = lapwing.fly("delivery_paper")
    (warning,) = [event for event in flight.events if event.kind == "warning"]
    assert warning.text == "motors take up to 311 A, rated 26.5 A; add effect dc_motor"
