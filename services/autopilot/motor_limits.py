"""Check of the motors' limits in hover."""

import math

from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.autopilot.controller_parameters import Airframe, hover_thrust, hover_torque
from lapwing.services.common.vehicle_schema import Effects, airframe


def check(scene: Scene, known: Airframe) -> None:
    """Check current, power and voltage of a motor in hover if `dc_motor` is active (theory.md, eq. (2.9)).

    Raises:
        ConfigError: a limit is exceeded.
    """
    if "dc_motor" not in scene[Effects].tables:
        return
    frame = airframe(scene)
    motor, constant = frame.motor, frame.motor.rotor_constant
    speed = math.sqrt(hover_thrust(known) / known.motor.thrust_coefficient)
    current = hover_torque(known) / (motor.belt_efficiency * constant) + motor.no_load_current
    voltage = constant * speed + (motor.resistance + motor.esc_resistance) * current
    for needed, limit, unit in (
        (current, frame.motor_current_limit, "A"),
        (current * voltage, motor.power_limit, "W"),
        (voltage, motor.max_voltage, "V"),
    ):
        if needed >= limit:
            message = f"hovering needs {needed:.1f} {unit} per motor, the limit is {limit:.1f} {unit}"
            raise ConfigError(
                "airframe.motor", message, "a lighter vehicle, or higher limits of motor, ESC and battery"
            )
