"""Payload that is released in flight."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import break_time, mass_properties, timed_update
from lapwing.dynamics.effects._types import AnyMassProperties, body_of, offset_body, principal_moments, steiner

Length = Annotated[float, Gt(0), Le(10)]


class Settings(NamedTuple):
    """Scene table."""

    release_time: Annotated[float, Ge(0)] | None = None  # [s] simulation time; default: no release without a command
    mass: Annotated[float, Gt(0)] | None = None  # [kg]; the airframe's payload if left out
    size: tuple[Length, Length, Length] = (0.20, 0.13, 0.23)  # [m] of the box along body x, y, z


class PayloadRelease(NamedTuple):
    """Uniform box whose mass and inertia the vehicle loses at its release.

    The airframe's [payload] sets its position, and the release moves the centre of mass (theory, eqs. (2.41) and
    (2.42)). Without that table the box is at the centre of mass (theory, eq. (2.26)). Source: the payload of
    Pappalardo et al. 2023, Table 2, size chosen; Steiner's theorem. Valid for a payload released at rest relative to
    the vehicle.
    """

    release_time: float  # [s]
    loaded: AnyMassProperties
    empty: AnyMassProperties

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "PayloadRelease":
        """Return mass properties with and without the box."""
        settings = validate_table(Settings, table)
        release = float("inf") if settings.release_time is None else settings.release_time
        if airframe.payload:
            if twice := {"mass", "size"} & set(table):
                raise ConfigError(min(twice), "set together with airframe.payload", "one of them")
            return cls(release, *_with_and_without(airframe))
        mass, total = airframe.mass.payload if settings.mass is None else settings.mass, airframe.mass.total
        if mass >= total:
            raise ConfigError("mass", f"got {mass}", f"less than the vehicle's {total} kg")
        x, y, z = settings.size
        box = (mass * (y * y + z * z) / 12.0, mass * (z * z + x * x) / 12.0, mass * (x * x + y * y) / 12.0)
        inertia, products = airframe.mass.inertia, airframe.mass.products
        rest = (inertia[0] - box[0], inertia[1] - box[1], inertia[2] - box[2])
        moments = principal_moments(rest, products)
        if moments[0] <= 0.0 or moments[2] > moments[0] + moments[1]:
            reject("has more inertia than the vehicle; reduce its mass or size")
        return cls(release, body_of(total, inertia, products), body_of(total - mass, rest, products))

    def initial_discrete_state(self) -> tuple[float]:
        """Return 0: not released; 1 is released."""
        return (0.0,)


def _with_and_without(airframe: Airframe) -> tuple[AnyMassProperties, AnyMassProperties]:
    """Return mass properties of the loaded vehicle, about its centre of mass, and of the vehicle without the box."""
    joint, box = airframe.mass, airframe.payload
    assert box is not None
    rest, place = joint.total - box.mass, np.array(box.position)
    centre = -box.mass / rest * place
    inertia = joint.matrix - box.inertia - steiner(box.mass, place) - steiner(rest, centre)
    return offset_body(joint.total, joint.matrix, np.zeros(3)), offset_body(rest, inertia, centre)


RELEASED = (1.0,)
"""Discrete state after the release: put it into the plant's state to release the payload on an event."""


@break_time(PayloadRelease)
def moment(e, memory, t, h, value):
    """Return the moment of the release if it is to come."""
    return min(value, e.release_time) if t < e.release_time else value


@timed_update(PayloadRelease)
def release(e, memory, t):
    """Release the payload at the release time."""
    return RELEASED if t >= e.release_time else memory


@mass_properties(PayloadRelease)
def payload_release(e, memory, before):
    """Return the mass properties with or without the box."""
    return e.empty if memory[0] > 0.0 else e.loaded
