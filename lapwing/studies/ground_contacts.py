"""Ground contacts of a vehicle: times and touch-down speeds."""

from typing import NamedTuple

import numpy as np

from lapwing.studies.topic_view import TopicView

BOUNCE = 0.5  # [s] shorter gaps between contacts do not separate two touches


class Touch(NamedTuple):
    """An interval on the ground, including bounces."""

    start: int  # row of the truth with the first contact
    stop: int  # row after the last contact
    speed: float  # [m/s] downwards just before the hardest contact; 0 if the vehicle starts on the ground


def ground_contacts(truth: TopicView) -> list[Touch]:
    """Return all intervals on the ground in order; empty for a plant without contact information."""
    contact = truth.ground_contact
    changed = (np.flatnonzero(contact[1:] != contact[:-1]) + 1).tolist()
    edges = [0] * bool(contact[0]) + changed + [len(contact)] * bool(contact[-1]) if len(contact) else []
    result: list[Touch] = []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        speed = max(-float(truth.velocity[start - 1, 2]), 0.0) if start else 0.0
        if result and truth.times[start] - truth.times[result[-1].stop - 1] < BOUNCE:
            result[-1] = Touch(result[-1].start, stop, max(result[-1].speed, speed))
        else:
            result.append(Touch(start, stop, speed))
    return result
