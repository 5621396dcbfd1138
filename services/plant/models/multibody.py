"""A multirotor whose propellers are bodies of their own, hinged to the chassis: the delivery drone's five bodies."""

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

from dynamics import effects
from dynamics.effects._types import Motion
from dynamics.lie.quaternion import exp, multiply, rotate, rotate_back
from dynamics.vector import Vec3, add, cross, scale
from dynamics.vehicles import multirotor
from dynamics.vehicles.multirotor import MultirotorParameters, hinges
from dynamics.vehicles.propellers import propellers_of
from messages import Actuators, Status
from messages.topics import BODIES, Topic
from services.plant import outputs
from services.plant.models import reduced
from services.scene import Scene, Section, WrongKeyError
from services.sections import active, airframe, gravity, period

NAMES = ("chassis", "propeller1", "propeller2", "propeller3", "propeller4")


class Multibody(Section):
    """What turns the propellers (theory.md, section 8.8)."""

    TABLE: ClassVar[str] = "multibody"
    drive: Literal["torque", "speed"] = "torque"  # 10 degrees of freedom, or 6 and an imposed speed


def check(scene: Scene) -> None:
    """As for the reduced model; and the airframe tells what a propeller weighs."""
    reduced.check(scene)
    try:
        propellers_of(airframe(scene), True, 0.0)
    except ValueError as error:
        raise WrongKeyError("vehicle.airframe", str(error)) from None


def create(scene: Scene) -> "FiveBodies":
    """The plant of a multirotor of five bodies."""
    return FiveBodies(scene, parameters(scene))


def parameters(scene: Scene) -> MultirotorParameters:
    """The plant's numbers; what the rotors' spin does to the body needs no effect here, it is the bodies' own."""
    frame = airframe(scene)
    inherent = effects.parameter_class("rotor_gyro")
    kept = tuple(e for e in active(scene) if not isinstance(e, inherent))
    driven = scene[Multibody].drive == "torque"
    return multirotor.parameters(frame, kept, propellers_of(frame, driven, gravity(scene)))


class FiveBodies(reduced.Reduced):
    """As the reduced plant, and what each propeller does and bears."""

    outputs = (*reduced.Reduced.outputs, BODIES)

    def __init__(self, scene: Scene, parameters: MultirotorParameters):
        super().__init__(scene, parameters)
        self._bodies_every = period(scene, BODIES)
        layout = parameters.layout
        self._hubs = list(zip(layout.x_body, layout.y_body, layout.z_body, strict=True))
        self._signs = layout.yaw_sign

    def prepare(self) -> None:
        """Compile or load the kernels."""
        super().prepare()
        hinges(self._parameters, 0, self._interval, self._state, self._off)

    def step(self, tick: int, actuators: Actuators | None, status: Status | None) -> Iterator[tuple[Topic, Any]]:
        """Advance to `tick` as the reduced plant does; the bodies come last."""
        yield from super().step(tick, actuators, status)
        if tick % self._bodies_every == 0:
            command = actuators.motor_voltage if actuators else self._off
            motion, force, torque = hinges(self._parameters, tick, self._interval, self._state, command)
            yield BODIES, self._bodies(tick * self._interval_ns, motion, force, torque)

    def _bodies(self, time_ns: int, m: Motion, force: tuple[Vec3, ...], torque: tuple[Vec3, ...]) -> Any:
        """Every body with the force and torque through its hinges; the chassis has the sum of the reactions."""
        motions, forces, torques = [m], [], []
        reaction, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for hub, sign, angle, speed, f, t in zip(
            self._hubs, self._signs, m.rotor_angle, m.rotor_speed, force, torque, strict=True
        ):
            own = exp((0.0, 0.0, angle))
            position = add(m.position_world, rotate(m.attitude, hub))
            velocity = add(m.velocity_world, rotate(m.attitude, cross(m.omega_body, hub)))
            omega = rotate_back(own, add(m.omega_body, (0.0, 0.0, -sign * speed)))
            motions.append(Motion(position, multiply(m.attitude, own), velocity, omega, ()))
            forces.append(rotate(m.attitude, f))
            torques.append(rotate_back(own, t))
            reaction = add(reaction, scale(-1.0, f))
            moment = add(moment, scale(-1.0, add(t, cross(hub, f))))
        whole = [rotate(m.attitude, reaction), *forces], [moment, *torques]
        return outputs.bodies(time_ns, NAMES, motions, *whole)
