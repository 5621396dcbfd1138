"""Steady flight against the plant, closed forms and Table 8 of the source."""

import math
from pathlib import Path

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.atmosphere import Atmosphere, density
from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.vehicles import multirotor, performance
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.inflow import thrust_in_wake

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
WEIGHT = DRONE.mass.total * 9.80665


def test_hover_values_follow_closed_forms():
    hover = performance.trim(DRONE)
    assert hover.tilt == pytest.approx(0.0, abs=1e-12)
    assert hover.thrust == pytest.approx(WEIGHT / 4)
    assert hover.rotor_speed * 30 / math.pi == pytest.approx(3169, abs=10)  # rpm, by hand from C_T
    assert hover.voltage == pytest.approx(hover.rotor_speed / (150 * 2 / 3 * math.pi / 30) + 0.085 * hover.current)


def test_plant_does_not_accelerate_at_trim():
    """The plant has drag, H-force and inflow at the tilt and rotor speed of the card."""
    tables = {"gravity": {}, "rotor_thrust": {}, "axial_inflow": {}, "body_drag": {}, "h_force": {}}
    p = multirotor.parameters(DRONE, effects.from_scene(tables, DRONE))
    for speed in (3.0, 12.0, 20.0):
        t = performance.trim(DRONE, speed)
        state = multirotor.initial_state(p, (0.0, 0.0, 20.0), exp((0.0, t.tilt, 0.0)), t.rotor_speed, (speed, 0.0, 0.0))
        result = multirotor.observe(p, 0, 0.004, state, (t.voltage,) * 4)
        assert result.acceleration_world == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
        assert result.thrust == pytest.approx((t.thrust,) * 4)
        assert t.current == pytest.approx(result.motor_current[0])


def test_thrust_over_weight_counts_resistance():
    ideal = DRONE.model_copy(update={"motor": DRONE.motor.model_copy(update={"resistance": 0.0})})
    assert performance.thrust_over_weight(DRONE) == pytest.approx(1.83, abs=0.01)
    hover = performance.trim(ideal)
    assert performance.thrust_over_weight(ideal) == pytest.approx((44.4 / hover.voltage) ** 2)


def test_power_has_minimum_and_grows_with_speed():
    power = [performance.trim(DRONE, v).power for v in np.linspace(0.0, performance.maximum_speed(DRONE), 30)]
    assert power[-1] > 1.5 * min(power)


def papers_density(height):
    """Return the density by the source's law, with the temperature of the ground."""
    return 1.293 * 273 / 288 * (1 - 0.0065 * height / 288) ** 5.2561


def test_table_8_of_source():
    """Hover time 19.3 min, payload 9.9 kg, ceiling 5.3 km, tilt 58.9 degrees, speed 20.7 m/s, range 12.1 km: an online
    estimator's figures; the last two depend on chosen drag areas."""
    assert performance.hover_time(DRONE) / 60 == pytest.approx(19.3, rel=0.05)
    assert performance.maximum_payload(DRONE) == pytest.approx(9.9, rel=0.05)
    assert performance.maximum_thrust(DRONE, papers_density(5300.0)) == pytest.approx(WEIGHT, rel=0.06)
    assert math.degrees(performance.maximum_tilt(DRONE)) == pytest.approx(58.9, abs=3)
    assert performance.maximum_speed(DRONE) == pytest.approx(20.7, rel=0.12)
    assert performance.maximum_range(DRONE)[0] == pytest.approx(12100, rel=0.35)


def test_at_ceiling_highest_thrust_is_weight():
    h = performance.ceiling(DRONE)
    assert performance.maximum_thrust(DRONE, density(Atmosphere(), h)) == pytest.approx(WEIGHT)
    assert performance.maximum_thrust(DRONE, papers_density(h)) < 0.93 * WEIGHT  # thinner aloft than the standard


def test_highest_speed_uses_all_voltage():
    top = performance.maximum_speed(DRONE)
    assert performance.trim(DRONE, top).voltage == pytest.approx(44.4)
    assert performance.maximum_range(DRONE)[1] <= top


def test_missing_parts_are_rejected():
    with pytest.raises(ValueError, match=r"no \[propeller\]"):
        performance.trim(DRONE.model_copy(update={"propeller": None}))
    with pytest.raises(ValueError, match=r"no \[battery\]"):
        performance.hover_time(DRONE.model_copy(update={"battery": None}))
    with pytest.raises(ValueError, match=r"no \[drag\]"):
        performance.trim(DRONE.model_copy(update={"drag": None}), 5.0)


def test_highest_thrust_keeps_current_and_power():
    def limited(**motor):
        frame = DRONE.model_copy(update={"motor": DRONE.motor.model_copy(update=motor)})
        thrust = performance.maximum_thrust(frame)
        return performance.trim(frame, mass=thrust / 9.80665), thrust

    whole, free = limited()
    assert whole.voltage == pytest.approx(44.4)
    by_current, less = limited(peak_current=12.0)
    assert by_current.current == pytest.approx(12.0)
    by_power, least = limited(peak_power=400.0)
    assert by_power.voltage * by_power.current == pytest.approx(400.0)
    assert max(less, least) < free


def test_tangentially_tilted_rotors_carry_less():
    """Rotors tilt 15 degrees along the circumference: the plant hovers at the card's trim and lifts cos(15 deg)."""
    lean = math.radians(15.0)
    axes = tuple(
        (-math.sin(lean) * y / math.hypot(x, y), math.sin(lean) * x / math.hypot(x, y), math.cos(lean))
        for x, y, _ in DRONE.rotors.position
    )
    frame = DRONE.model_copy(update={"rotors": DRONE.rotors.model_copy(update={"axis": axes})})
    assert performance.maximum_thrust(frame) == pytest.approx(math.cos(lean) * performance.maximum_thrust(DRONE))
    p = multirotor.parameters(frame, effects.from_scene({"gravity": {}, "rotor_thrust": {}}, frame))
    t = performance.trim(frame)
    state = multirotor.initial_state(p, (0.0, 0.0, 20.0), rotor_speed=t.rotor_speed)
    result = multirotor.observe(p, 0, 0.004, state, (t.voltage,) * 4)
    assert result.acceleration_world == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def stacked(drone):
    """Return an airframe with a counter-rotating rotor 0.1 m above each rotor."""
    r = drone.rotors
    hubs = tuple((x, y, z) for x, y, _ in r.position for z in (0.0, 0.1))
    spins = tuple(way for spin in r.spin_direction for way in (spin, "cw" if spin == "ccw" else "ccw"))
    return drone.model_copy(update={"rotors": r.model_copy(update={"position": hubs, "spin_direction": spins})})


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 6.0, 14.0])
def test_trim_of_coaxial_rotors_equals_plant(speed):
    """The plant with `coaxial_interference` hovers at the card's trim and draws the card's current."""
    frame = stacked(DRONE)
    tables = {"gravity": {}, "rotor_thrust": {}, "axial_inflow": {}, "body_drag": {}, "coaxial_interference": {}}
    p = multirotor.parameters(frame, effects.from_scene(tables, frame))
    t = performance.trim(frame, speed, rotor=performance.rotor_of(frame)._replace(drag=0.0))
    state = multirotor.initial_state(p, (0.0, 0.0, 20.0), exp((0.0, t.tilt, 0.0)), t.rotor_speed, (speed, 0.0, 0.0))
    result = multirotor.observe(p, 0, 0.004, state, (t.voltage,) * 8)
    assert result.acceleration_world == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert result.thrust[1] == pytest.approx(t.thrust)
    assert t.current == pytest.approx(max(result.motor_current))


def test_lower_rotor_thrust_follows_momentum_theory():
    """The lower rotors of four pairs have 0.44 of the thrust, at the voltage limit of four isolated rotors."""
    frame, rotor = stacked(DRONE), performance.rotor_of(stacked(DRONE))
    lost = 1.0 - thrust_in_wake.py_func(rotor.wash.pitch, 1.0)
    assert lost == pytest.approx(0.56, abs=0.01)
    alone = performance.maximum_thrust(frame, rotor=rotor._replace(wash=None))
    assert performance.maximum_thrust(frame) == pytest.approx((1.0 - 0.5 * lost) * alone, rel=1e-9)
    assert performance.thrust_over_weight(frame) == pytest.approx(2.0 * 0.72 * 1.83, rel=0.01)
    twice = frame.model_copy(update={"mass": frame.mass.model_copy(update={"total": 2.0 * DRONE.mass.total})})
    assert performance.trim(twice).power > 1.2 * 2.0 * performance.trim(DRONE).power
    assert performance.hover_time(twice) < 0.42 * performance.hover_time(DRONE)
