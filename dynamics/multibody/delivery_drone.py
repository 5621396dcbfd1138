"""The five-body delivery drone in least coordinates, for the plant: chassis pose and four propeller angles.

No constraint can drift; the multibody system is solved on the fast path at every call. Built from numbers passed in.
"""

import math
from typing import NamedTuple

from dynamics.integrators import RATES
from dynamics.kernel import kernel, leaf
from dynamics.lie import quaternion
from dynamics.lie.quaternion import Quaternion
from dynamics.multibody.arrow import Core, Leaf, eliminate
from dynamics.vector import ZERO, Vec3, add, apply, apply_transposed, cross, multiply, scale, subtract

Four = tuple[float, ...]


class Drone(NamedTuple):
    """Mass properties; the chassis carries the payload. Propeller k turns about z, its centre of mass at hubs[k]."""

    mass: float  # chassis [kg]
    inertia: Vec3  # chassis about its centre of mass, principal moments along the body axes [kg m^2]
    hubs: tuple[Vec3, ...]  # [m], chassis axes
    propeller_mass: Four  # [kg]; 0 for one that was torn off
    propeller_inertia: tuple[Vec3, ...]  # principal moments, x along the blade, z the spin axis [kg m^2]
    spins: Four  # 1: torque-driven, 0: imposed speed


class DroneState(NamedTuple):
    """A state tree for `dynamics.integrators`."""

    position_world: Vec3  # of the chassis' centre of mass [m]
    attitude: Quaternion
    velocity_world: Vec3  # [m/s]
    omega_body: Vec3  # [rad/s]
    angles: Four  # of the propellers about z relative to the chassis [rad]
    speeds: Four  # [rad/s]


class Loads(NamedTuple):
    """What acts from outside and what the motors do; thrust and aerodynamic torque act on the propellers."""

    force_world: Vec3  # at the chassis' centre of mass, gravity not included [N]
    torque_body: Vec3  # on the chassis [N m]
    thrust: Four  # along body z at each hub [N]
    aerodynamic_torque: Four  # about body z on each propeller, against its turning [N m]
    drive: Four  # motor torque chassis -> propeller about z [N m] if it spins; imposed acceleration [rad/s^2] if not
    gravity_world: Vec3  # [m/s^2]


class Motion(NamedTuple):
    """Accelerations, and the reactions between chassis and propellers."""

    acceleration_world: Vec3  # of the chassis' centre of mass [m/s^2]
    angular_acceleration_body: Vec3  # [rad/s^2]
    spin_acceleration: Four  # of the propellers relative to the chassis [rad/s^2]
    drive_torque: Four  # chassis -> propeller about z [N m]
    reaction_force_body: tuple[Vec3, ...]  # chassis -> propeller [N]
    reaction_torque_body: tuple[Vec3, ...]  # the same about the hub [N m], its z the drive torque


class Flight(NamedTuple):
    """Parameters of `rate`: a drone and its loads, constant over a step."""

    drone: Drone
    loads: Loads


def delivery_drone(
    *,
    central_frame,
    payload,
    frame_inertia,
    propeller,
    propeller_inertia,
    arm_length,
    rotor_sign_x,
    rotor_sign_y,
    driven="torque",
) -> Drone:
    """The paper's five bodies (Tables 2, 3) from SI numbers under the names of facts/delivery_drone.toml.

    Args:
        central_frame, payload, propeller: masses [kg].
        frame_inertia, propeller_inertia: principal moments [kg m^2], shape (3,).
        arm_length: hub distance from the chassis' centre of mass [m]; the signs place hub k at 45 degrees.
        driven: "torque" (10 degrees of freedom) or "speed" (6).

    Raises:
        ValueError: a mass or moment that is not positive, signs that are not +1 or -1, an unknown drive.
    """
    positive = {
        "central_frame": (central_frame,), "propeller": (propeller,), "arm_length": (arm_length,),
        "frame_inertia": frame_inertia, "propeller_inertia": propeller_inertia,
    }  # fmt: skip
    for key, values in positive.items():
        if not all(math.isfinite(v) and v > 0.0 for v in values):
            raise ValueError(f"{key} must be positive, not {values}")
    if not payload >= 0.0:
        raise ValueError(f"payload must not be negative, not {payload}")
    if driven not in ("torque", "speed"):
        raise ValueError(f"unknown drive {driven!r}: choose one of torque, speed")
    signs = list(zip(rotor_sign_x, rotor_sign_y, strict=True))
    if len(signs) != 4 or any(abs(s) != 1 for pair in signs for s in pair):
        raise ValueError(f"rotor_sign_x and rotor_sign_y must hold +1 or -1 for four rotors, not {signs}")
    side = arm_length / math.sqrt(2.0)
    ix, iy, iz = (float(v) for v in frame_inertia)
    bx, by, bz = (float(v) for v in propeller_inertia)
    spins = 1.0 if driven == "torque" else 0.0
    return Drone(
        float(central_frame + payload),
        (ix, iy, iz),
        tuple((sx * side, sy * side, 0.0) for sx, sy in signs),
        (float(propeller),) * 4,
        ((bx, by, bz),) * 4,
        (spins,) * 4,
    )


def without_propeller(drone: Drone, k: int) -> Drone:
    """The drone after propeller k (0 to 3) was torn off; its angle and speed in the state mean nothing any more."""
    masses, inertias = list(drone.propeller_mass), list(drone.propeller_inertia)
    masses[k], inertias[k] = 0.0, ZERO
    return drone._replace(propeller_mass=tuple(masses), propeller_inertia=tuple(inertias))


@leaf
def _propeller(d, x, loads, g, k):
    """Propeller k as a leaf in chassis axes; its inertia turns with it at twice the speed (theory.md, eq. (8.50))."""
    moments, offset, speed, w = d.propeller_inertia[k], d.hubs[k], x.speeds[k], x.omega_body
    spins, gone = d.spins[k], d.propeller_mass[k] == 0.0
    mean, half = 0.5 * (moments[0] + moments[1]), 0.5 * (moments[0] - moments[1])
    c, s = half * math.cos(2.0 * x.angles[k]), half * math.sin(2.0 * x.angles[k])
    own = (w[0], w[1], w[2] + speed)
    momentum = ((mean + c) * own[0] + s * own[1], s * own[0] + (mean - c) * own[1], moments[2] * own[2])
    turn = (w[1] * speed, -w[0] * speed, loads.drive[k] * (1.0 - spins))
    drag, thrust = (0.0, 0.0) if gone else (loads.aerodynamic_torque[k], loads.thrust[k])
    weight = scale(d.propeller_mass[k], g)
    gyroscopic = cross(own, momentum)
    return Leaf(
        d.propeller_mass[k],
        (mean + c, mean - c, (1.0 - spins) * moments[2], s, 0.0, 0.0),
        offset,
        (0.0, 0.0, 1.0),
        moments[2],
        spins,
        0.0 if gone else loads.drive[k] * spins,
        cross(w, cross(w, offset)),
        turn,
        (weight[0], weight[1], weight[2] + thrust),
        (-gyroscopic[0], -gyroscopic[1], drag - gyroscopic[2]),
    )


@leaf
def motion(d, loads, x):
    """Accelerations and reactions of a drone under loads in a state (theory.md, eqs. (8.40)-(8.45), (8.50))."""
    R = quaternion.rotation_matrix(x.attitude)
    g = apply_transposed(R, loads.gravity_world)
    w = x.omega_body
    core = Core(
        d.mass,
        (d.inertia[0], d.inertia[1], d.inertia[2], 0.0, 0.0, 0.0),
        add(scale(d.mass, g), apply_transposed(R, loads.force_world)),
        subtract(loads.torque_body, cross(w, multiply(d.inertia, w))),
    )
    leaves = (
        _propeller(d, x, loads, g, 0),
        _propeller(d, x, loads, g, 1),
        _propeller(d, x, loads, g, 2),
        _propeller(d, x, loads, g, 3),
    )
    s = eliminate(core, leaves)
    l1, l2, l3, l4 = s.leaves
    t1, t2, t3, t4 = l1.reaction_torque, l2.reaction_torque, l3.reaction_torque, l4.reaction_torque
    imposed, k = loads.drive, d.spins
    return Motion(
        apply(R, s.acceleration),
        s.angular_acceleration,
        (
            l1.spin + (1.0 - k[0]) * imposed[0],
            l2.spin + (1.0 - k[1]) * imposed[1],
            l3.spin + (1.0 - k[2]) * imposed[2],
            l4.spin + (1.0 - k[3]) * imposed[3],
        ),
        (t1[2], t2[2], t3[2], t4[2]),
        (l1.reaction_force, l2.reaction_force, l3.reaction_force, l4.reaction_force),
        (t1, t2, t3, t4),
    )


@kernel
def rate(p, t, x):
    """Tangent of a `DroneState` for parameters `Flight`."""
    m = motion(p.drone, p.loads, x)
    return DroneState(
        x.velocity_world, x.omega_body, m.acceleration_world, m.angular_acceleration_body, x.speeds, m.spin_acceleration
    )


RATES[Flight] = rate


@kernel
def solve(drone, loads, x):
    """`motion` as a function of its own, for callers outside compiled code."""
    return motion(drone, loads, x)
