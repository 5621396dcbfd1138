"""Scenes that the autopilot cannot fly are rejected at resolution."""

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.vehicles import performance
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.services.scene_resolver import load

DRONE = load_airframe(SHIPPED / "vehicles" / "delivery_drone.toml")
ELECTRIC = {"effects.dc_motor": {}}
SENSORS = {"autopilot.estimator": "kalman", "sensors": {"imu": {}, "magnetometer": {}, "gps": {}}}


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"airframe.mass.total": 25.0}, "thrust of 48.3 N per rotor is below the 61.3 N"),
        ({"airframe.motor.peak_current": 3.0, **ELECTRIC}, "A per motor, the limit is 3.0 A"),
        ({"airframe.battery.c_rating": 1.0, **ELECTRIC}, "A per motor, the limit is 2.5 A"),
        ({"airframe.motor.peak_power": 20.0, **ELECTRIC}, "W per motor, the limit is 20.0 W"),
        ({"airframe.motor.max_voltage": 32.0, **ELECTRIC}, "V per motor, the limit is 32.0 V"),
    ],
)
def test_vehicle_that_cannot_hover(overrides, message):
    with pytest.raises(SceneError, match=f"airframe.*{message}"):
        load("hover", overrides)


def test_hover_limit_equals_performance_card():
    """A weight just below the maximum thrust is accepted, one just above it is rejected."""
    heaviest = performance.maximum_thrust(DRONE, 1.225) / STANDARD_GRAVITY
    scene = {**ELECTRIC, "environment.home.height": 0.0}
    load("hover", {**scene, "vehicle.mass": 0.999 * heaviest})
    with pytest.raises(SceneError, match="hovering needs"):
        load("hover", {**scene, "vehicle.mass": 1.001 * heaviest})


def test_slung_load_too_heavy_for_rotors_is_rejected():
    with pytest.raises(SceneError, match=r"slung_load.mass: expected a lighter load .*got 20: the rotors lift at most"):
        load("slung_load", {"slung_load.mass": 20.0})


def test_vertical_magnetic_field_is_rejected_on_sensors():
    with pytest.raises(
        SceneError, match=r"environment.magnetic_field: expected at least 1e-06 T, got 0 T horizontally"
    ):
        load("hover", {**SENSORS, "environment.magnetic_field": [0.0, 0.0, -4e-5]})
    load("hover", {"environment.magnetic_field": [0.0, 0.0, -4e-5]})  # accepted: this flight uses the ground truth
