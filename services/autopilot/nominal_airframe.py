"""Nominal vehicle parameters of the autopilot."""

import math

from lapwing.cosim.scene import Scene
from lapwing.services.autopilot.controller_parameters import Airframe, lift, moments
from lapwing.services.autopilot.motor import Motor
from lapwing.services.common.schemas import vehicle_schema
from lapwing.services.common.schemas.vehicle_schema import (
    Effects,
    airframe,
    gravity,
    rotor_constants,
    start_height,
    wake_slopes,
)


def known_airframe(scene: Scene) -> Airframe:
    """Return the nominal vehicle parameters in the air at home."""
    return scene.cached(_known_airframe)


def _known_airframe(scene: Scene) -> Airframe:
    frame = airframe(scene)
    rotor = rotor_constants(scene)
    torque_per_thrust = rotor.torque / rotor.thrust
    thrust_coefficient = vehicle_schema.thrust_coefficient(scene)
    x, y, z = zip(*frame.rotors.position, strict=True)
    axis = frame.rotors.tilted_axis
    engine = frame.motor
    drag = scene[Effects].tables.get("rotational_drag", {}).get("linear", (0.0, 0.0, 0.0))
    nominal = Airframe(
        frame.mass.total,
        frame.mass.inertia,
        x,
        y,
        frame.rotors.reaction_sign,
        torque_per_thrust,
        Motor(thrust_coefficient, engine.gear_ratio, engine.speed_constant, engine.time_constant),
        engine.max_voltage,
        start_height(scene),
        gravity(scene),
        rotor_z=z if axis else (),
        rotor_axis=axis,
        rotational_drag=(float(drag[0]), float(drag[1]), float(drag[2])),
    )
    isolated, nominal = nominal, nominal._replace(wakes=wake_slopes(scene))
    if "gyroscopic_torque" not in scene[Effects].tables or nominal.gravity <= 0.0:
        return nominal
    slope = 2.0 * math.sqrt(nominal.mass * nominal.gravity / lift(nominal) * thrust_coefficient)  # [N s/rad] in hover
    # thrust of tilted rotors also causes yaw, and of their spin-up torque only the z component does
    torque = moments(nominal)[2] / lift(isolated) if axis or nominal.wakes.thrust else torque_per_thrust
    return nominal._replace(spin_up_zero=frame.rotors.inertia / (slope * torque))
