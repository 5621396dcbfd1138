"""Loads in hover against the motor's equations by hand and the battery's circuit."""

import math
from pathlib import Path

import pytest

from lapwing.dynamics.vehicles import hover_loads
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.propeller import thrust_coefficient, torque_coefficient

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
WEIGHT = DRONE.mass.total * 9.80665


def test_power_and_throttle_follow_from_motor_equations():
    motor, propeller = DRONE.motor, DRONE.propeller
    turns = math.sqrt(WEIGHT / 4 / (thrust_coefficient(propeller) * 1.225 * propeller.diameter**4))  # [1/s]
    torque = torque_coefficient(propeller) * 1.225 * turns**2 * propeller.diameter**5
    constant = 30.0 / (math.pi * motor.speed_constant * motor.gear_ratio)  # [V s/rad] of the geared motor
    current = torque / constant / motor.belt_efficiency + motor.no_load_current
    voltage = constant * 2.0 * math.pi * turns + (motor.resistance + motor.esc_resistance) * current
    assert hover_loads.motor_current(DRONE) == pytest.approx(current)
    assert hover_loads.throttle(DRONE) == pytest.approx(voltage / motor.max_voltage)
    assert hover_loads.power(DRONE) == pytest.approx(4 * voltage * current / motor.esc_efficiency)
    assert hover_loads.esc_margin(DRONE) == pytest.approx(1.0 - current / motor.esc_current)


def test_battery_current_closes_circuit():
    battery, current = DRONE.battery, hover_loads.current(DRONE)
    terminal = battery.cells * (3.7 - battery.cell_resistance * current)
    assert terminal * current == pytest.approx(hover_loads.power(DRONE))
    limit = battery.c_rating * battery.capacity / 3600.0
    assert hover_loads.battery_margin(DRONE) == pytest.approx(1.0 - current / limit)


def test_battery_with_too_little_power_is_named():
    weak = DRONE.battery.model_copy(update={"cell_resistance": 1.0})
    with pytest.raises(ValueError, match="the battery cannot give"):
        hover_loads.current(DRONE.model_copy(update={"battery": weak}))
