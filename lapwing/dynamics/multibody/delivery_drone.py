"""Five-body delivery drone in minimal coordinates, for the plant: chassis pose and four propeller angles.

No constraint can drift; the multibody system is solved on the fast path at every call. All numbers are arguments.
"""

from collections.abc import Sequence
from typing import NamedTuple

from lapwing.dynamics.integrators import RATES
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.multibody.arrowhead_solver import Core, HingedBody, eliminate
from lapwing.dynamics.vector import Vec3, add, apply, apply_transposed, cross, multiply, scale, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.simd import deinterleave, interleave, unpack4

Four = tuple[float, ...]


class Drone(NamedTuple):
    """Mass properties; the chassis includes the payload. Propeller k turns about z; its centre of mass is hubs[k]."""

    mass: float  # chassis [kg]
    inertia: Vec3  # chassis about its centre of mass, principal moments along the body axes [kg m^2]
    hubs: tuple[Vec3, ...]  # [m], chassis axes
    propeller_mass: Four  # [kg]
    propeller_inertia: tuple[Vec3, ...]  # principal moments, x along the blade, z the spin axis [kg m^2]
    spins: Four  # 1: torque-driven, 0: imposed speed
    held: Four = (1.0, 1.0, 1.0, 1.0)  # 0: torn off


class DroneState(NamedTuple):
    """State tree for `lapwing.dynamics.integrators`."""

    position_world: Vec3  # [m] centre of mass of the chassis
    attitude: Quaternion
    velocity_world: Vec3  # [m/s]
    omega_body: Vec3  # [rad/s]
    angles: Four  # [rad] angles of the propellers about z, relative to the chassis
    speeds: Four  # [rad/s]


class Loads(NamedTuple):
    """External loads and motor torques; thrust and aerodynamic torque act on the propellers."""

    force_world: Vec3  # [N] at the chassis' centre of mass, without gravity
    torque_body: Vec3  # on the chassis [N m]
    thrust: Four  # along body z at each hub [N]
    aerodynamic_torque: Four  # about body z on each propeller, against its turning [N m]
    drive: Four  # motor torque chassis -> propeller about z [N m] if it spins; imposed acceleration [rad/s^2] if not
    gravity_world: Vec3  # [m/s^2]


class Accelerations(NamedTuple):
    """Accelerations, and the reactions between chassis and propellers."""

    acceleration_world: Vec3  # [m/s^2] centre of mass of the chassis
    angular_acceleration_body: Vec3  # [rad/s^2]
    spin_acceleration: Four  # [rad/s^2] propellers relative to the chassis
    drive_torque: Four  # chassis -> propeller about z [N m]
    reaction_force_body: tuple[Vec3, ...]  # chassis -> propeller [N]
    reaction_torque_body: tuple[Vec3, ...]  # [N m] torque about the hub; its z component is the drive torque


class Flight(NamedTuple):
    """Parameters of `rate`: a drone and its loads, constant over a step."""

    drone: Drone
    loads: Loads


def delivery_drone(
    *,
    central_frame: float,
    payload: float,
    frame_inertia: Sequence[float],
    propeller: float,
    propeller_inertia: Sequence[float],
    arm_length: float,
    rotor_sign_x: Sequence[float],
    rotor_sign_y: Sequence[float],
    driven: str = "torque",
) -> Drone:
    """Return the paper's five bodies (Tables 2, 3) from SI numbers under the names of facts/delivery_drone.toml.

    Args:
        central_frame, payload, propeller: masses [kg].
        frame_inertia, propeller_inertia: principal moments [kg m^2], shape (3,).
        arm_length: hub distance from the chassis' centre of mass [m]; the signs place hub k at 45 degrees.
        driven: "torque" (10 degrees of freedom) or "speed" (6).

    Raises:
        ValueError: a mass or moment that is not positive, signs other than +1 and -1, or an unknown drive.
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
        raise ValueError(f"rotor_sign_x and rotor_sign_y must contain +1 or -1 for four rotors, not {signs}")
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


@always_inline
def _double(angles):
    """Return cosines and sines of twice the angles."""
    c, s = math.cos, math.sin
    a, b, d, e = 2.0 * angles[0], 2.0 * angles[1], 2.0 * angles[2], 2.0 * angles[3]
    return interleave((c(a), c(b), c(d), c(e))), interleave((s(a), s(b), s(d), s(e)))


@always_inline
def _propellers(d, x, loads, g):
    """Return the propellers as leaves in chassis axes; their inertia varies at twice the speed (eq. (8.50))."""
    w, speed, spins, attached = x.omega_body, interleave(x.speeds), interleave(d.spins), interleave(d.held)
    offset, drive = interleave(d.hubs), interleave(loads.drive)
    mass, inertia = attached * interleave(d.propeller_mass), interleave(d.propeller_inertia)
    moments = scale(attached, inertia)
    cosine, sine = _double(x.angles)
    mean, half = 0.5 * (moments[0] + moments[1]), 0.5 * (moments[0] - moments[1])
    c, s = half * cosine, half * sine
    own = (w[0], w[1], w[2] + speed)
    momentum = ((mean + c) * w[0] + s * w[1], s * w[0] + (mean - c) * w[1], moments[2] * own[2])
    gyroscopic = cross(own, momentum)
    weight, zero = scale(mass, g), 0.0 * mass
    return HingedBody(
        mass,
        (mean + c, mean - c, (1.0 - spins) * moments[2], s, zero, zero),
        offset,
        (zero, zero, 1.0 + zero),
        inertia[2],
        spins,
        attached * drive,
        cross(w, cross(w, offset)),
        (w[1] * speed, -w[0] * speed, drive * (1.0 - spins)),
        (weight[0], weight[1], weight[2] + attached * interleave(loads.thrust)),
        (-gyroscopic[0], -gyroscopic[1], attached * interleave(loads.aerodynamic_torque) - gyroscopic[2]),
    )


@always_inline
def motion(d, loads, x):
    """Return accelerations and reactions of a drone under loads in a state (theory, eqs. (8.40)-(8.45), (8.50))."""
    R = quaternion.rotation_matrix(x.attitude)
    g = apply_transposed(R, loads.gravity_world)
    w = x.omega_body
    core = Core(
        d.mass,
        (d.inertia[0], d.inertia[1], d.inertia[2], 0.0, 0.0, 0.0),
        add(scale(d.mass, g), apply_transposed(R, loads.force_world)),
        subtract(loads.torque_body, cross(w, multiply(d.inertia, w))),
    )
    s = eliminate(core, _propellers(d, x, loads, g))
    attached, spins = interleave(d.held), interleave(d.spins)
    spin = attached * (s.spin + (1.0 - spins) * interleave(loads.drive))
    return Accelerations(
        apply(R, s.acceleration),
        s.angular_acceleration,
        unpack4(spin),
        unpack4(s.reaction_torque[2]),
        deinterleave(s.reaction_force),
        deinterleave(s.reaction_torque),
    )


@kernel
def rate(p, t, x):
    """Return the tangent of a `DroneState` for parameters `Flight`."""
    m = motion(p.drone, p.loads, x)
    return DroneState(
        x.velocity_world, x.omega_body, m.acceleration_world, m.angular_acceleration_body, x.speeds, m.spin_acceleration
    )


RATES[Flight] = rate


@kernel
def solve(drone, loads, x):
    """Call `motion` from outside compiled code."""
    return motion(drone, loads, x)
