"""How a flight ended. The criteria are here alone: for a run, its report, a campaign, and the tests."""

import math
from typing import Literal, NamedTuple, get_args

import numpy as np

from lapwing.studies.ground_contacts import Touch, touches
from lapwing.studies.topic_view import TopicView

Kind = Literal["landed", "crashed", "timed out", "diverged", "broken off", "flown"]
KINDS = get_args(Kind)

HARD = 2.0  # [m/s] downwards at a touch: a crash
UPSIDE = 0.0  # cosine of the tilt below which the vehicle has turned over: a crash
SLOW = 0.5  # [m/s] a vehicle that has landed moves less
UPRIGHT = math.cos(math.radians(30.0))  # and is tilted less
RESTING = 0.1  # [m] from the height at which it stood at first; for plants that tell of no contact


class FlightOutcome(NamedTuple):
    """How a flight ended, when and where.

    "landed": the mission is over, upright and at rest on its feet. "crashed": it turned over, hit the ground at more
    than 2 m/s, or the mission was over and it did not stand. "timed out": the mission was not over. "diverged": a state
    was no longer finite. "broken off": something else ended the run before its time. "flown": nobody steers in this
    scene, so nothing has to land.
    """

    kind: Kind
    time: float  # [s] of the last touch-down, of the crash, or of the end
    how: str  # the circumstances, for people
    position: tuple[float, float, float]  # [m] world, at the end
    tilt: float  # [rad] from the vertical, at the end
    touchdown: float  # [m/s] speed downwards at the hardest touch; 0 without one

    def __str__(self) -> str:
        """The verdict as a sentence without its full stop."""
        if self.kind == "flown":
            return f"Flown to the end, {self.time:.2f} s: {self.how}"
        x, y, z = self.position
        where = "" if self.kind in ("diverged", "broken off") else f"; ends at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        return f"{self.kind.capitalize()} at {self.time:.2f} s{': ' if self.how else ''}{self.how}{where}"


def judge(truth: TopicView, status: TopicView | None, failure: str = "", diverged: bool = False) -> FlightOutcome:
    """The verdict on a flight.

    Args:
        truth: at least one message.
        status: of the autopilot; None where nobody steers.
        failure: why the flight ended before its time; "" where it did not.
        diverged: whether that is a state that was no longer finite.
    """
    end, cosine = float(truth.times[-1]), truth.tilt_cosine
    found = touches(truth) if status is not None else []
    x, y, z = map(float, truth.position[-1])
    tilt = math.acos(max(-1.0, min(1.0, float(cosine[-1]))))

    def verdict(kind: Kind, time: float, how: str) -> FlightOutcome:
        return FlightOutcome(
            kind, round(time, 9), how, (x, y, z), tilt, max((touch.speed for touch in found), default=0.0)
        )

    if diverged:
        return verdict("diverged", end, failure)
    if status is None:
        return (
            verdict("broken off", end, failure)
            if failure
            else verdict("flown", end, "nobody steers, so nothing has to land")
        )
    if accident := _accident(truth, cosine, found):
        return verdict("crashed", *accident)
    if failure:
        return verdict("broken off", end, failure)
    if not over(status):
        return verdict("timed out", end, _unfinished(status))
    if wrong := _not_standing(truth, status, cosine):
        return verdict("crashed", end, wrong)
    # the last touch before the motors went off; a plant that tells of no contact has none
    time = float(truth.times[found[-1].start]) if found else end
    return verdict("landed", time, f"upright on its feet, touched down at {found[-1].speed:.2f} m/s" if found else "")


def over(status: TopicView) -> bool:
    """Whether the mission is over: as the autopilot says, or flown, landed and disarmed under an operator."""
    if len(status) == 0:
        return False
    if status.finished[-1]:
        return True
    if "mode" not in status.fields:
        return False
    # along the scene's own trajectory a stop on the ground is a part of the mission; its mode is "mission"
    at_rest = status.landed[-1] and not status.armed[-1] and status.mode[-1] == "hold"
    return bool(at_rest and status.armed.any())


def _accident(truth: TopicView, cosine: np.ndarray, found: list[Touch]) -> tuple[float, str] | None:
    """When it crashed first, and all that happened; None where it did not."""
    told = []
    over_turned = np.flatnonzero(cosine < UPSIDE)
    if len(over_turned):
        told.append((float(truth.times[over_turned[0]]), "turned over"))
    for touch in found:
        if touch.speed > HARD:
            told.append((float(truth.times[touch.start]), f"hit the ground at {touch.speed:.1f} m/s"))
    if not told:
        return None
    (time, first_words), *others = sorted(told)
    return time, ", ".join([first_words, *(f"{words} at {t:.2f} s" for t, words in others)])


def _not_standing(truth: TopicView, status: TopicView, cosine: np.ndarray) -> str:
    """What is wrong with a vehicle whose mission is over; "" if it stands."""
    height, speed = truth.position[:, 2], float(np.linalg.norm(truth.velocity[-1]))
    wrong = []
    if not status.landed[-1]:
        wrong.append("the autopilot does not say that it has landed")
    if not (truth.ground_contact[-1] or abs(height[-1] - height[0]) < RESTING):
        wrong.append("not on the ground")
    if not cosine[-1] > UPRIGHT:
        wrong.append(f"tilted by {math.degrees(math.acos(max(-1.0, min(1.0, float(cosine[-1]))))):.0f}°")
    if not speed < SLOW:
        wrong.append(f"moves at {speed:.1f} m/s")
    return f"the mission is over, but it does not stand: {', '.join(wrong)}" if wrong else ""


def _unfinished(status: TopicView) -> str:
    if not ("armed" in status.fields and status.armed.any()):
        return "the mission was not over, the motors were never armed"
    doing = " ".join(filter(None, (str(status.mode[-1]), f"({status.phase[-1]})" if status.phase[-1] else "")))
    return f"the mission was not over, in {doing}"
