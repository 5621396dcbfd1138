"""Multirotor of five bodies: chassis and four propellers on hinges, under the effects of its scene.

Parameters, propeller failures and initial state; the equations of motion are in `multirotor_multibody_equations`.
"""

from typing import TYPE_CHECKING, Any

from lapwing.dynamics.effects._types import PerRotor
from lapwing.dynamics.effects.gyroscopic_torque import GyroscopicTorque
from lapwing.dynamics.multibody import five_bodies, five_body_stabilisation
from lapwing.dynamics.multibody.delivery_drone import Drone
from lapwing.dynamics.multibody.five_bodies import BodyState
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorParameters, MultirotorState
from lapwing.dynamics.vehicles.multirotor_multibody_equations import Assembly

if TYPE_CHECKING:  # services do not import pydantic
    from lapwing.dynamics.vehicles.airframe import Airframe

FEEDBACK = 50.0  # [1/s] rate of Baumgarte's stabilisation
BECOMES = {  # failures of a propeller: (spins, powered, held)
    "locked": (0.0, 0.0, 1.0),  # its speed relative to the chassis becomes zero
    "free": (1.0, 0.0, 1.0),  # its motor has no torque, the air brakes it
    "torn_off": (1.0, 0.0, 0.0),  # without hinge and drive: only gravity acts on it, and no ground stops it
}
STABILISATIONS = {
    "none": five_body_stabilisation.NONE, "partitioning": five_body_stabilisation.PARTITION, "projection":
    five_body_stabilisation.PROJECTION, "baumgarte": five_body_stabilisation.NONE,
}  # fmt: skip


def drone_of(airframe: "Airframe", drive: str = "torque") -> Drone:
    """Return the five bodies of an airframe; its inertia is the frame's, its mass includes the propellers.

    Raises:
        ValueError: "key: message"; not four rotors, no data of a single rotor, tilted rotors, or products of inertia.
    """
    rotors = airframe.rotors
    if len(rotors.position) != 4 or rotors.mass is None or rotors.blade_inertia is None:
        raise ValueError("rotors: the five-body model needs four rotors with mass and blade_inertia")
    if airframe.payload:
        raise ValueError("payload: the five-body model does not support it; remove the table")
    if rotors.tilted_axis:
        raise ValueError("rotors.axis: the five-body model needs rotors that push along body z")
    if any(airframe.mass.products):
        raise ValueError("mass.products: the five-body model needs principal axes, and products of 0")
    spins = 1.0 if drive == "torque" else 0.0
    mass = airframe.mass.total - 4.0 * rotors.mass
    blade = (*rotors.blade_inertia, rotors.inertia)
    return Drone(mass, airframe.mass.inertia, rotors.position, (rotors.mass,) * 4, (blade,) * 4, (spins,) * 4)


def parameters(
    airframe: "Airframe", effects: tuple = (), drive: str = "torque", stabilisation: str = "projection"
) -> MultirotorParameters:
    """Return the plant's parameters. See `multirotor.parameters`.

    Args:
        airframe: airframe with four rotors and the data of a single rotor.
        effects: from `lapwing.dynamics.effects.from_scene`; `gyroscopic_torque` is left out, since bodies include it.
        drive: "torque" (the motors' torque turns the propellers) or "speed" (their acceleration is imposed).
        stabilisation: one of STABILISATIONS.

    Raises:
        ValueError: see `drone_of`.
    """
    feedback = FEEDBACK if stabilisation == "baumgarte" else 0.0
    assembly = Assembly(drone_of(airframe, drive), STABILISATIONS[stabilisation], feedback, (1.0,) * 4, ())
    p = multirotor.parameters(airframe, tuple(e for e in effects if not isinstance(e, GyroscopicTorque)))
    return p._replace(layout=p.layout._replace(bodies=assembly))


def with_propeller_failure(p: MultirotorParameters, k: int, becomes: str) -> MultirotorParameters:
    """Return the parameters after a failure in BECOMES of propeller k (0 to 3); see `apply_constraint_impulse`."""

    def replace_entry(values: PerRotor, value: float) -> PerRotor:
        return (*values[:k], value, *values[k + 1 :])

    bodies, (spins, powered, held) = p.layout.bodies, BECOMES[becomes]
    drone = bodies.drone._replace(
        spins=replace_entry(bodies.drone.spins, spins), held=replace_entry(bodies.drone.held, held)
    )
    bodies = bodies._replace(drone=drone, powered=replace_entry(bodies.powered, powered))
    return p._replace(layout=p.layout._replace(bodies=bodies))


def initial_state(p: MultirotorParameters, *start: Any, **named: Any) -> MultirotorState:
    """Return a state with the blades along x; see `multirotor.initial_state`."""
    plain = multirotor.initial_state(p, *start, **named)
    motion, d = plain.motion, p.layout.bodies.drone
    chassis = BodyState(motion.position_world, motion.attitude, motion.velocity_world, motion.omega_body)
    speeds = tuple(-sign * speed for sign, speed in zip(p.layout.reaction_sign, motion.rotor_speed, strict=True))
    x = five_body_stabilisation.assembled_state(
        five_bodies.machine(d, ZERO, speeds=speeds), chassis, (0.0,) * 4, speeds
    )
    return plain._replace(motion=x)
