"""Output of the unloading crate's bodies: pack, door, rollers and ground, with the contact force on each."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.lie.quaternion import NO_ROTATION, exp
from lapwing.dynamics.vector import ZERO, Vec3, add, scale
from lapwing.kernels import always_inline, math
from lapwing.papers.unloading import unloading, unloading_contact_points
from lapwing.papers.unloading.unloading import UnloadingParameters, UnloadingState
from lapwing.services.common.ports import BodyMotions

NAMES = ("pack", "door", *[f"roller{i + 1}" for i in range(unloading_contact_points.ROLLERS)], "ground")


class UnloadingView(NamedTuple):
    """Parameters of the block."""

    carrier: UnloadingParameters
    interval: float  # [s] length of a tick


@always_inline
def _roller(p: UnloadingParameters, i: int) -> Vec3:
    """Return the position of a roller's axis [m]."""
    forward = (math.cos(p.tilt), 0.0, -math.sin(p.tilt))
    upward = (math.sin(p.tilt), 0.0, math.cos(p.tilt))
    behind = scale(-(i + 0.5) * p.roller_spacing, forward)
    return add((0.0, 0.0, p.floor_height), add(behind, scale(p.roller_radius, upward)))


@always_inline
def _on_roller(rollers: tuple[Vec3, ...], i: int) -> Vec3:
    """Return the force of the pack on a roller [N]."""
    return scale(-1.0, add(add(ZERO, rollers[2 * i]), rollers[2 * i + 1]))


@always_inline
def step(
    p: UnloadingView, s: UnloadingState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[UnloadingState, tuple[BodyMotions], int]:
    """Output the motions of the bodies at `tick`; the door lies along z of its frame."""
    c, t = p.carrier, tick * p.interval
    rollers, door, ground, walls = unloading.forces_on_pack(c, t, s)
    on_pack = ZERO
    for force in rollers:
        on_pack = add(on_pack, force)
    on_pack = add(add(add(on_pack, door), ground), walls)
    hinge, along = (0.0, 0.0, c.floor_height), exp((0.0, c.tilt, 0.0))
    turning = (0.0, unloading_contact_points.roller_speed(c, t), 0.0)
    sample = BodyMotions(
        (s.position_world, hinge, _roller(c, 0), _roller(c, 1), _roller(c, 2), _roller(c, 3), ZERO),
        (s.attitude, exp((0.0, c.tilt + s.door[0], 0.0)), along, along, along, along, NO_ROTATION),
        (s.velocity_world, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO),
        (s.omega_body, (0.0, s.door[1], 0.0), turning, turning, turning, turning, ZERO),
        (
            on_pack, scale(-1.0, door),
            _on_roller(rollers, 0), _on_roller(rollers, 1), _on_roller(rollers, 2), _on_roller(rollers, 3),
            scale(-1.0, ground),
        ),
        (ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO),
    )  # fmt: skip
    return s, (sample,), CONTINUE
