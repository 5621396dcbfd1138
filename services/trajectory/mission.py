"""A trajectory of named phases, compiled to pieces that can be evaluated at any time (theory.md, section 4.1)."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from dynamics.vector import ZERO, Vec3
from services.trajectory.config import Phase, Trajectory
from services.trajectory.piece import Channel, Parameters, Piece

CHANNELS = ("x", "y", "z", "yaw")
GROUNDED = 1e-6  # [m] a phase that ends lower ends on the ground
SLACK = 1e-9  # [s] rounding allowed between a phase's duration and the sum of its segments


class Compiled(NamedTuple):
    """What `compile` gives."""

    parameters: Parameters  # for piece.evaluate
    phases: tuple[str, ...]  # names, by the index that evaluate returns
    duration: float  # [s]
    final: int  # index of the first phase after which none ends in the air


def compile(
    spec: Trajectory | dict, origin_world: Vec3 = ZERO, origin_yaw: float = 0.0, folder: Path = Path()
) -> Compiled:
    """Compile a trajectory about an origin (position in world [m], yaw [rad]); CSV files are looked up from `folder`.

    Raises ValueError (one line: where, what) for a malformed description, a phase shorter than its segments, or a
    segment that does not join the one before.
    """
    trajectory = validate(spec)
    joined: dict[str, list[tuple[float, Piece]]] = {channel: [] for channel in CHANNELS}
    value = dict.fromkeys(CHANNELS, 0.0)
    starts, now, final = [], 0.0, 0
    for index, phase in enumerate(trajectory.phase):
        starts.append(now)
        moved = {channel: _pieces(phase, channel, value, folder) for channel in CHANNELS}
        length = {channel: sum(piece.duration for piece in pieces) for channel, pieces in moved.items()}
        end = now + _phase_duration(phase, max(length.values()))
        for channel, pieces in moved.items():
            time = now
            for piece in pieces:
                joined[channel].append((time, piece))
                time += piece.duration
            joined[channel].append((min(time, end), Piece(0.0, (value[channel],))))
        now = end
        final = index + 1 if value["z"] > GROUNDED else final
    parameters = Parameters(
        **{channel: _channel(joined[channel]) for channel in CHANNELS},
        phase_start=np.array(starts),
        origin_world=origin_world,
        origin_yaw=float(origin_yaw),
    )
    return Compiled(parameters, tuple(phase.name for phase in trajectory.phase), now, final)


def validate(spec: Trajectory | dict) -> Trajectory:
    """The validated trajectory; raises ValueError with one line."""
    try:
        return Trajectory.model_validate(spec)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in ("trajectory", *first["loc"]))
        raise ValueError(f"{where}: {first['msg'].removeprefix('Value error, ')}") from None


def _pieces(phase: Phase, channel: str, value: dict[str, float], folder: Path) -> list[Piece]:
    """The pieces of a channel in a phase; moves `value` on to where they end."""
    pieces = []
    for segment in getattr(phase, channel):
        try:
            pieces += segment.pieces(value[channel], folder)
            value[channel] = segment.end(value[channel], folder)
        except ValueError as error:
            raise ValueError(f"phase {phase.name!r}, {channel}: {error}") from None
    return pieces


def _phase_duration(phase: Phase, longest: float) -> float:
    if phase.duration is None:
        return longest
    if longest > phase.duration + SLACK:
        raise ValueError(
            f"phase {phase.name!r}: its segments last {longest:g} s, longer than its duration {phase.duration:g} s"
        )
    return phase.duration


def _channel(joined: list[tuple[float, Piece]]) -> Channel:
    # Of pieces that start together only the last one counts: holds of no length and the values jumped over.
    kept = dict(joined)
    return Channel(np.array(list(kept)), np.array([piece.row() for piece in kept.values()]))
