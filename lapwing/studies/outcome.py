"""Outcome of a flight: the classification as landed, crashed, timed out and so on."""

import math
from typing import Literal, NamedTuple, get_args

import numpy as np

from lapwing.studies.ground_contacts import Touch, ground_contacts
from lapwing.studies.mission import Mission
from lapwing.studies.topic_view import TopicView

Kind = Literal[
    "landed", "completed", "landed elsewhere", "ended in failsafe", "timed out", "aborted", "crashed", "diverged"
]
KINDS = get_args(Kind)  # from best to worst
LANDED = ("landed", "landed elsewhere", "ended in failsafe")  # kinds of a vehicle at rest on its feet

HARD = 2.0  # [m/s] downward speed at a touch above which it is a crash
UPSIDE = 0.0  # cosine of the tilt below which the vehicle has turned over: a crash
SLOW = 0.5  # [m/s] largest speed of a vehicle at rest
UPRIGHT = math.cos(math.radians(30.0))  # cosine of the largest tilt of a vehicle at rest
RESTING = 0.1  # [m] largest difference from the initial height at rest, for plants without contact information
LANDING_RADIUS = 5.0  # [m] horizontal distance from the mission's target: uncorrected satellite navigation


class FlightOutcome(NamedTuple):
    """Outcome of a flight: kind, time and place.

    - "landed": the mission is finished; the vehicle is upright and at rest within 5 m of the mission's target.
    - "completed": the flight reached its end and no landing is required: no autopilot, no mission, a trajectory that
      ends in the air, or a run that ends before its trajectory.
    - "landed elsewhere": as "landed", but farther from the target.
    - "ended in failsafe": a failsafe ended the mission and the vehicle landed.
    - "timed out": the mission was not finished, or the vehicle never left the ground.
    - "aborted": another failure ended the run early.
    - "crashed": the vehicle turned over, hit the ground at more than 2 m/s, or was not at rest on its feet after the
      mission.
    - "diverged": a state was not finite.
    """

    kind: Kind
    time: float  # [s] of the last touch-down, of the crash, or of the end
    how: str  # circumstances
    position: tuple[float, float, float]  # [m] world, at the end
    tilt: float  # [rad] from the vertical, at the end
    touchdown: float  # [m/s] speed downwards at the hardest touch; 0 without one
    target_distance: float | None = None  # [m] horizontal distance from the mission's target at the end
    failsafe: str = ""  # reason of the failsafe in which the flight ended
    failsafe_time: float | None = None  # [s] of its start

    def __str__(self) -> str:
        """Return the outcome as a sentence without its full stop."""
        if self.kind == "completed":
            return f"Completed at {self.time:.2f} s: {self.how}"
        x, y, z = self.position
        where = "" if self.kind in ("diverged", "aborted") else f"; ends at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        return f"{self.kind.capitalize()} at {self.time:.2f} s{': ' if self.how else ''}{self.how}{where}"


def classify(
    truth: TopicView,
    status: TopicView | None,
    failure: str = "",
    diverged: bool = False,
    mission: Mission | None = None,
) -> FlightOutcome:
    """Return the outcome of a flight.

    Args:
        truth: true state; at least one message.
        status: autopilot status; None without an autopilot.
        failure: reason of an early end; "" without one.
        diverged: True if a state is non-finite.
        mission: mission of the autopilot; None without one.
    """
    end, cosine = float(truth.times[-1]), truth.tilt_cosine
    contacts = ground_contacts(truth) if status is not None else []
    x, y, z = map(float, truth.position[-1])
    tilt = math.acos(max(-1.0, min(1.0, float(cosine[-1]))))
    distance = None
    if mission is not None and mission.target is not None:
        distance = math.hypot(x - mission.target[0], y - mission.target[1])
    hardest = max((touch.speed for touch in contacts), default=0.0)

    def outcome(kind: Kind, time: float, how: str, failsafe: tuple[float, str] | None = None) -> FlightOutcome:
        started, reason = failsafe or (None, "")
        return FlightOutcome(kind, round(time, 9), how, (x, y, z), tilt, hardest, distance, reason, started)

    if diverged:
        return outcome("diverged", end, failure)
    if status is None:
        return outcome("aborted", end, failure) if failure else outcome("completed", end, "no autopilot")
    failsafe = _last_failsafe(status)
    if accident := _accident(truth, cosine, contacts):
        return outcome("crashed", *accident, failsafe)
    if failure:
        return outcome("aborted", end, failure, failsafe)
    landed_in_failsafe = failsafe and status.landed[-1] and not status.armed[-1]
    if not mission_finished(status) and not landed_in_failsafe:
        completion = "no mission" if mission is None else mission.completion(status)
        if completion and not failsafe:
            return outcome("completed", end, completion)
        return outcome("timed out", end, _unfinished_outcome(status, failsafe), failsafe)
    if mission is not None and contacts and contacts[0].stop - contacts[0].start == len(truth.times):
        return outcome("timed out", end, "never took off" + _failsafe_text(failsafe), failsafe)
    if fault := _not_resting(truth, status, cosine):
        return outcome("crashed", end, fault, failsafe)
    # the last touch before the motors stopped; without contact information, the end
    time = float(truth.times[contacts[-1].start]) if contacts else end
    how = [f"upright on its feet, touched down at {contacts[-1].speed:.2f} m/s"] if contacts else []
    if failsafe:
        how.insert(0, f"{failsafe[1]} at {failsafe[0]:.2f} s")
    is_far = distance is not None and distance > LANDING_RADIUS
    if distance is not None and (failsafe or is_far):
        how.append(f"{distance:.1f} m from the target")
    kind: Kind = "ended in failsafe" if failsafe else "landed elsewhere" if is_far else "landed"
    return outcome(kind, time, ", ".join(how), failsafe)


def mission_finished(status: TopicView) -> bool:
    """Return True if the autopilot reports the end, or has landed and disarmed after a flight under an operator."""
    if len(status) == 0:
        return False
    if status.finished[-1]:
        return True
    if "mode" not in status.fields:
        return False
    # a stop on the ground along the scene's trajectory is a part of the mission, in the mode "mission"
    at_rest = status.landed[-1] and not status.armed[-1] and status.mode[-1] == "hold"
    return bool(at_rest and status.armed.any())


def _last_failsafe(status: TopicView) -> tuple[float, str] | None:
    """Return start [s] and reason of the failsafe active when the motors were last armed, or None without one."""
    if not {"failsafe", "text", "armed"} <= set(status.fields):
        return None
    armed = np.flatnonzero(status.armed)
    if not len(armed) or not status.failsafe[armed[-1]]:
        return None
    without = np.flatnonzero(~status.failsafe[: armed[-1]].astype(bool))
    first = int(without[-1]) + 1 if len(without) else 0
    return float(status.times[first]), str(status.text[first]) or "failsafe"


def _accident(truth: TopicView, cosine: np.ndarray, contacts: list[Touch]) -> tuple[float, str] | None:
    """Return the time [s] of the first accident and a text that lists all, or None without one."""
    accidents = []
    turned_over = np.flatnonzero(cosine < UPSIDE)
    if len(turned_over):
        accidents.append((float(truth.times[turned_over[0]]), "turned over"))
    for touch in contacts:
        if touch.speed > HARD:
            accidents.append((float(truth.times[touch.start]), f"hit the ground at {touch.speed:.1f} m/s"))
    if not accidents:
        return None
    (time, first), *others = sorted(accidents)
    return time, ", ".join([first, *(f"{text} at {t:.2f} s" for t, text in others)])


def _not_resting(truth: TopicView, status: TopicView, cosine: np.ndarray) -> str:
    """Return the reasons why a vehicle is not at rest on its feet after its mission; "" if it is."""
    height, speed = truth.position[:, 2], float(np.linalg.norm(truth.velocity[-1]))
    faults = []
    if not status.landed[-1]:
        faults.append("the autopilot does not report a landing")
    if not (truth.ground_contact[-1] or abs(height[-1] - height[0]) < RESTING):
        faults.append("not on the ground")
    if not cosine[-1] > UPRIGHT:
        faults.append(f"tilted by {math.degrees(math.acos(max(-1.0, min(1.0, float(cosine[-1]))))):.0f}°")
    if not speed < SLOW:
        faults.append(f"moves at {speed:.1f} m/s")
    return f"not at rest on its feet after the mission: {', '.join(faults)}" if faults else ""


def _unfinished_outcome(status: TopicView, failsafe: tuple[float, str] | None) -> str:
    if not ("armed" in status.fields and status.armed.any()):
        return "mission not finished, motors never armed"
    mode = " ".join(filter(None, (str(status.mode[-1]), f"({status.phase[-1]})" if status.phase[-1] else "")))
    where = f", in {mode}" if mode else ""  # a firmware may not have reported its mode
    return f"mission not finished{where}{_failsafe_text(failsafe)}"


def _failsafe_text(failsafe: tuple[float, str] | None) -> str:
    return f", {failsafe[1]} at {failsafe[0]:.2f} s" if failsafe else ""
