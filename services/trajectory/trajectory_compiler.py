"""Compiler of phases into polynomial pieces that can be evaluated at any time (theory, section 4.1)."""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import math
from lapwing.services.trajectory.phases import Phase, Phases
from lapwing.services.trajectory.polynomial_piece import Channel, Parameters, Piece

CHANNELS = ("x", "y", "z", "yaw")
GROUNDED = 1e-6  # [m] a phase that ends lower ends on the ground
SLACK = 1e-9  # [s] rounding allowed between a phase's duration and the sum of its segments


class CompiledTrajectory(NamedTuple):
    """Result of `compile`."""

    parameters: Parameters  # for `polynomial_piece.evaluate`
    phases: tuple[str, ...]  # names by index
    duration: float  # [s]
    final: int  # index of the first phase after which none ends in the air


def compile(trajectory: Phases, origin_world: Vec3 = ZERO, origin_yaw: float = 0.0) -> CompiledTrajectory:
    """Compile a trajectory about an origin (position in world [m], yaw [rad]).

    Raises:
        ConfigError: a phase is shorter than its segments, or a segment does not join its predecessor.
    """
    timeline: dict[str, list[tuple[float, Piece]]] = {channel: [] for channel in CHANNELS}
    value = dict.fromkeys(CHANNELS, 0.0)
    starts, now, final = [], 0.0, 0
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
            timeline[channel].append((min(time, end), Piece(0.0, (value[channel],))))
        now = end
        final = index + 1 if value["z"] > GROUNDED else final
    parameters = Parameters(
        **{channel: _channel(timeline[channel]) for channel in CHANNELS},
        phase_start=np.array(starts),
        phase_release=np.array([float(phase.release) for phase in trajectory.phase]),
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
