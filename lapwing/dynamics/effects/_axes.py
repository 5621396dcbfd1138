"""Rotor axes: a direction for each rotor, or body z without cost if the airframe defines none.

`layout.axis` is () or, for each rotor, the unit vector of its thrust in body coordinates. The choice is part of the
type, so it is made when the plant is compiled.
"""

import math
from collections.abc import Callable
from typing import Any

from numba import types

from lapwing.dynamics.effects._rotor_sums import total, total_wrench
from lapwing.dynamics.vector import add, apply, apply_transposed, cross, dot, norm, pair, product, scale, subtract
from lapwing.kernels import always_inline, python_function
from lapwing.kernels.codegen import map_tuple, overload_for


def by_axis(along_z: Callable, tilted: Callable, axis: tuple, arguments: Any) -> Any:
    """Call the compiled `along_z(given)` for an empty tuple `axis`, otherwise `tilted(given)`; chosen by type."""
    return python_function(tilted if axis else along_z)(arguments)


@overload_for(by_axis, inline=True)
def _by_axis(along_z, tilted, axis, arguments):
    if len(axis):
        return lambda along_z, tilted, axis, arguments: tilted(arguments)
    return lambda along_z, tilted, axis, arguments: along_z(arguments)


@always_inline
def _place(_, plan, height):
    return plan[0], plan[1], height


@always_inline
def places(layout):
    """Return the position of each rotor [m], body coordinates."""
    plan = map_tuple(pair, 0.0, layout.x_body, layout.y_body)
    return map_tuple(_place, 0.0, plan, layout.z_body)


@always_inline
def _thrust_along_z(arguments):
    layout, loads = arguments
    return total(loads.thrust), (
        total(map_tuple(product, 0.0, layout.y_body, loads.thrust)),
        -total(map_tuple(product, 0.0, layout.x_body, loads.thrust)),
        total(map_tuple(product, 0.0, layout.reaction_sign, loads.torque)),
    )


@always_inline
def _push(_, axis, load):
    """Return (force [N], torque [N m]) of a rotor: r x T a + s Q a (theory, eq. (1.6b))."""
    place, thrust, reaction = load
    force = scale(thrust, axis)
    return force, add(cross(place, force), scale(reaction, axis))


@always_inline
def _load(_, place, both):
    return place, both[0], both[1]


@always_inline
def _thrust_tilted(arguments):
    layout, loads = arguments
    reaction = map_tuple(product, 0.0, layout.reaction_sign, loads.torque)
    pushes = map_tuple(_load, 0.0, places(layout), map_tuple(pair, 0.0, loads.thrust, reaction))
    return total_wrench(map_tuple(_push, 0.0, layout.axis, pushes))


@always_inline
def thrust_wrench(layout, loads):
    """Return (thrust, torque [N m]) of all rotors in body coordinates.

    The thrust [N] is a number along body z, or a vector if the rotors have axes of their own.
    """
    return by_axis(_thrust_along_z, _thrust_tilted, layout.axis, (layout, loads))


def in_world(thrust: Any, R_world_body: tuple) -> tuple:
    """Return the thrust of `thrust_wrench`, world coordinates [N]."""
    if isinstance(thrust, tuple):
        return apply(R_world_body, thrust)
    return (thrust * R_world_body[2], thrust * R_world_body[5], thrust * R_world_body[8])


@overload_for(in_world, inline=True)
def _in_world(thrust, R_world_body):
    if isinstance(thrust, types.BaseTuple):
        return lambda thrust, R_world_body: apply(R_world_body, thrust)
    # a number needs only the third column
    return lambda thrust, R_world_body: (
        thrust * R_world_body[2], thrust * R_world_body[5], thrust * R_world_body[8],
    )  # fmt: skip


def beside(thrust: Any, force: tuple) -> tuple:
    """Return the thrust of `thrust_wrench` added to a force, body coordinates [N]."""
    return add(force, thrust) if isinstance(thrust, tuple) else (force[0], force[1], force[2] + thrust)


@overload_for(beside, inline=True)
def _beside(thrust, force):
    if isinstance(thrust, types.BaseTuple):
        return lambda thrust, force: add(force, thrust)
    return lambda thrust, force: (force[0], force[1], force[2] + thrust)


@always_inline
def air_body(s):
    """Return (velocity [m/s], rate [rad/s]) of the body relative to the air, body coordinates."""
    air = apply_transposed(s.R_world_body, subtract(s.motion.velocity_world, s.air.wind_world))
    return air, subtract(s.motion.omega_body, s.air_rate_body)


@always_inline
def _axial_along_z(c, x, y):
    axial, omega = c
    return axial + omega[0] * y - omega[1] * x


@always_inline
def _axial_speeds_along_z(s):
    air, omega = air_body(s)
    return map_tuple(_axial_along_z, (air[2], omega), s.layout.x_body, s.layout.y_body)


@always_inline
def _axial_tilted(c, place, axis):
    air, omega = c
    return dot(axis, add(air, cross(omega, place)))


@always_inline
def _axial_speeds_tilted(s):
    return map_tuple(_axial_tilted, air_body(s), places(s.layout), s.layout.axis)


@always_inline
def axial_speeds(s):
    """Return the air speed of each hub along its rotor's axis [m/s], including the rotation of the body."""
    return by_axis(_axial_speeds_along_z, _axial_speeds_tilted, s.layout.axis, s)


@always_inline
def _hub_along_z(c, plan, z):
    air, omega = c
    x, y = plan
    ahead, aside = air[0] + omega[1] * z - omega[2] * y, air[1] + omega[2] * x - omega[0] * z
    return air[2] + omega[0] * y - omega[1] * x, math.sqrt(ahead * ahead + aside * aside)


@always_inline
def _hubs_along_z(s):
    plan = map_tuple(pair, 0.0, s.layout.x_body, s.layout.y_body)
    return map_tuple(_hub_along_z, air_body(s), plan, s.layout.z_body)


@always_inline
def _hub_tilted(c, place, axis):
    air, omega = c
    speed = add(air, cross(omega, place))
    axial = dot(axis, speed)
    return axial, norm(subtract(speed, scale(axial, axis)))


@always_inline
def _hubs_tilted(s):
    return map_tuple(_hub_tilted, air_body(s), places(s.layout), s.layout.axis)


@always_inline
def hub_speeds(s):
    """Return (axial, transverse) air speed of each hub [m/s], including the rotation of the body."""
    return by_axis(_hubs_along_z, _hubs_tilted, s.layout.axis, s)
