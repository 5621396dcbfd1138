"""Compiler of phases into polynomial pieces that can be evaluated at any time (theory, section 4.1)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import math, python_function
from lapwing.services.trajectory.phases import Phase, Phases
from lapwing.services.trajectory.polynomial_piece import Channel, Parameters, Piece, channel_at

CHANNELS = ("x", "y", "z", "yaw")
GROUNDED = 1e-6  # [m] a phase that ends lower ends on the ground
ON_OBSTACLE = 0.05  # [m] a trajectory that ends lower above an obstacle ends on it
CONTACT_SPEED = 0.3  # [m/s] at which it goes on downwards
IN_THE_AIR = -1.0  # landing speed of a phase that does not end on the ground
SLACK = 1e-9  # [s] rounding allowed between a phase's duration and the sum of its segments


class CompiledTrajectory(NamedTuple):
    """Result of `compile`."""

    parameters: Parameters  # for `polynomial_piece.evaluate`
    phases: tuple[str, ...]  # names by index
    duration: float  # [s]
    final: int  # index of the first phase after which none ends in the air


def compile(
    trajectory: Phases,
    origin_world: Vec3 = ZERO,
    origin_yaw: float = 0.0,
    ground: Callable[[float, float], float] = lambda x, y: 0.0,
) -> CompiledTrajectory:
    """Compile a trajectory about an origin (position in world [m], yaw [rad]).

    `ground` is the height [m] of the ground, or of the obstacle on it, at a displacement x, y [m]. A trajectory that
    ends on or in an obstacle goes on downwards, for the vehicle to land on it.

    Raises:
        ConfigError: a phase is shorter than its segments, or a segment does not join its predecessor.
    """
    timeline: dict[str, list[tuple[float, Piece]]] = {channel: [] for channel in CHANNELS}
    value = dict.fromkeys(CHANNELS, 0.0)
    starts, landing_speeds, now, final, last = [], [], 0.0, 0, 0.0
    for index, phase in enumerate(trajectory.phase):
        starts.append(now)
        key = f"trajectory.phase.{index}"
        pieces_of = {channel: _pieces(phase, key, channel, value) for channel in CHANNELS}
        length = {channel: math.total(piece.duration for piece in pieces) for channel, pieces in pieces_of.items()}
        end = now + _phase_duration(phase, key, max(length.values()))
        for channel, pieces in pieces_of.items():
            time = now
            for piece in pieces:
                timeline[channel].append((time, piece))
                time += piece.duration
            last = max(last, time) if pieces else last
            timeline[channel].append((min(time, end), Piece(0.0, (value[channel],))))
        now = end
        landing_speeds.append(_final_descent(pieces_of["z"]) if abs(value["z"]) <= GROUNDED else IN_THE_AIR)
        final = index + 1 if value["z"] > GROUNDED else final
    if GROUNDED < value["z"] <= ground(value["x"], value["y"]) + ON_OBSTACLE:
        descent = Piece(value["z"] / CONTACT_SPEED, (value["z"], -CONTACT_SPEED))
        before = [entry for entry in timeline["z"] if entry[0] < last]
        timeline["z"] = [*before, (last, descent), (last + descent.duration, Piece(0.0, (0.0,)))]
        final = next((index - 1 for index, start in enumerate(starts) if start >= last - SLACK), len(starts) - 1)
        landing_speeds[final:] = [CONTACT_SPEED] * (len(starts) - final)
    parameters = Parameters(
        **{channel: _channel(timeline[channel]) for channel in CHANNELS},
        phase_start=np.array(starts),
        phase_release=np.array([float(phase.release) for phase in trajectory.phase]),
        phase_landing_speed=np.array(landing_speeds),
        origin_world=origin_world,
        origin_yaw=float(origin_yaw),
    )
    return CompiledTrajectory(parameters, tuple(phase.name for phase in trajectory.phase), now, final)


def _pieces(phase: Phase, key: str, channel: str, value: dict[str, float]) -> list[Piece]:
    """Return the pieces of a channel in a phase and update `value` to their end."""
    pieces = []
    for segment in getattr(phase, channel):
        try:
            pieces += segment.pieces(value[channel])
        except ConfigError as error:
            raise error.with_prefix(f"{key}.{channel}") from None
        value[channel] = segment.end(value[channel])
    return pieces


def _final_descent(pieces: list[Piece]) -> float:
    """Return the speed downwards [m/s] at the end of the last piece; 0 if the channel holds or rises."""
    if not pieces:
        return 0.0
    last = Channel(np.array([0.0]), np.array([pieces[-1].row()]))
    _, rate, _ = python_function(channel_at)(last, pieces[-1].duration)
    return max(0.0, -float(rate))


def _phase_duration(phase: Phase, key: str, longest: float) -> float:
    if phase.duration is None:
        return longest
    if longest > phase.duration + SLACK:
        message = f"got {phase.duration:g} s in phase {phase.name!r}"
        raise ConfigError(f"{key}.duration", message, f"at least the duration of its segments, {longest:g} s")
    return phase.duration


def _channel(timeline: list[tuple[float, Piece]]) -> Channel:
    # The last of several pieces with the same start wins: the others have no length.
    pieces = dict(timeline)
    return Channel(np.array(list(pieces)), np.array([piece.row() for piece in pieces.values()]))
