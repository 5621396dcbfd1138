"""Outcome of a flight: the classification as landed, crashed, timed out and so on, and the judgement of a landing."""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple, get_args

import numpy as np

from lapwing.cosim.config.provenance import ENDED
from lapwing.flights.contacts import BOUNCE, HARD, Touch
from lapwing.flights.mission import Mission
from lapwing.flights.topic_view import TopicView
from lapwing.services.common.schemas.success_criteria import Kind

LANDED = ("landed", "landed elsewhere", "ended in failsafe")  # kinds of a vehicle at rest on its feet
FAILED = ("crashed", "diverged")
NEVER_LEFT = "never left the ground"
MOST_CONSEQUENCES = 3  # in the text of an outcome

HARDER, SOFT = 1.1, 0.1  # a touch is harder than commanded above 1.1 times that speed; never below 0.1 m/s
COMMANDED_TIME = 0.5  # [s] before a touch, over which the largest descent speed of the setpoint is the commanded one
UPSIDE = 0.0  # cosine of the tilt below which the vehicle has turned over: a crash
SLOW = 0.5  # [m/s] largest speed of a vehicle at rest
LYING = math.radians(30.0)  # least tilt of a vehicle that does not rest on its feet
UPRIGHT = math.cos(LYING)
RESTING = 0.1  # [m] largest difference from the initial height at rest, for plants without contact information
TRYING = 1.0  # [s] with motors after which a vehicle on the ground should have left it
LANDING_RADIUS = 5.0  # [m] horizontal distance from the mission's target: uncorrected satellite navigation


Mark = Literal["good", "warn", "bad"]  # green, yellow and red wherever a flight is shown
MARKS = get_args(Mark)  # from best to worst


class Incident(NamedTuple):
    """Something that happened in an accident."""

    time: float  # [s]
    text: str


class FlightOutcome(NamedTuple):
    """Outcome of a flight: kind, time and place.

    - "landed": the mission is finished; the vehicle is upright and at rest within 5 m of the mission's target.
    - "completed": the flight reached its end and no landing is required: no autopilot, no mission, a trajectory that
      ends in the air, or a run that ends before its trajectory. Without a mission, or if the run ends before the
      take-off, the vehicle may still stand on the ground, which is a cause.
    - "landed elsewhere": as "landed", but farther from the target.
    - "ended in failsafe": a failsafe ended the mission and the vehicle landed.
    - "timed out": the mission was not finished, or the vehicle never left the ground.
    - "aborted": another failure ended the run early; not a run that its user ended after the vehicle has landed.
    - "crashed": the vehicle turned over, hit the ground, an obstacle or another vehicle at more than 2 m/s, passed
      through another vehicle, or was not at rest on its feet after the mission.
    - "diverged": a state was not finite.
    """

    kind: Kind
    time: float  # [s] of the last touch-down, of the crash, or of the end
    how: str  # circumstances
    position: tuple[float, float, float]  # [m] world, at the end
    tilt: float  # [rad] from the vertical, at the end
    touchdown: float  # [m/s] speed downwards at the hardest touch; 0 without one
    commanded: float | None = None  # [m/s] descent speed commanded just before that touch; None if unknown
    target_distance: float | None = None  # [m] horizontal distance from the mission's target at the end
    failsafe: str = ""  # reason of the failsafe in which the flight ended
    failsafe_time: float | None = None  # [s] of its start
    causes: tuple[Incident, ...] = ()  # of a crash or another failure, the first cause first; flaws without a crash
    consequences: tuple[Incident, ...] = ()  # alarms after a crash

    def __str__(self) -> str:
        """Return the outcome as one to three sentences without the last full stop."""
        if self.kind == "completed":
            return f"Completed at {self.time:.2f} s: {self.how}"
        x, y, z = (round(value, 2) + 0.0 for value in self.position)  # no -0.00
        tilted = f"tilted by {math.degrees(self.tilt):.0f}° " if self.kind == "crashed" and self.tilt > LYING else ""
        where = "" if self.kind in ("diverged", "aborted") else f"; ends {tilted}at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        later = [f"{text} {time - self.time:.2f} s later" for time, text in self.consequences[:MOST_CONSEQUENCES]]
        if hidden := len(self.consequences) - len(later):
            later.append(f"{hidden} more")
        after = f". After the crash: {', '.join(later)}" if later else ""
        return f"{self.kind.capitalize()} at {self.time:.2f} s{': ' if self.how else ''}{self.how}{where}{after}"

    @property
    def mark(self) -> Mark:
        """Judgement of the flight, for its colour."""
        if self.kind in ("landed elsewhere", "timed out"):
            return "warn"
        if self.kind not in ("landed", "completed"):
            return "bad"
        hard = self.kind == "landed" and self.touchdown > self.touchdown_limit
        return "warn" if hard or self.causes else "good"

    @property
    def failed(self) -> bool:
        """True if the vehicle is lost: nothing of such a flight is good."""
        return self.kind in FAILED

    @property
    def touchdown_limit(self) -> float:
        """Speed [m/s] above which the hardest touch is harder than commanded; that of a crash if none is known."""
        return _harder(self.commanded)


def classify(
    truth: TopicView,
    status: TopicView | None,
    failure: str = "",
    diverged: bool = False,
    mission: Mission | None = None,
    contacts: Sequence[Touch] = (),
    setpoint: TopicView | None = None,
) -> FlightOutcome:
    """Return the outcome of a flight.

    Args:
        truth: true state; at least one message.
        status: autopilot status; None without an autopilot.
        failure: reason of an early end; "" without one.
        diverged: True if a state is non-finite.
        mission: mission of the autopilot; None without one.
        contacts: contacts of the vehicle.
        setpoint: setpoint of the autopilot, if any.
    """
    end, cosine = float(truth.times[-1]), truth.tilt_cosine
    touches = [touch for touch in contacts if touch.lands] if status is not None else []
    x, y, z = map(float, truth.position[-1])
    tilt = math.acos(max(-1.0, min(1.0, float(cosine[-1]))))
    distance = None
    if mission is not None and mission.target is not None:
        distance = math.hypot(x - mission.target[0], y - mission.target[1])
    hardest = max(touches, key=lambda touch: touch.speed, default=None)
    speed, commanded = 0.0, None
    if hardest is not None:
        speed, commanded = hardest.speed, commanded_descent(setpoint, float(truth.times[hardest.start]))

    def outcome(kind: Kind, time: float, how: str, failsafe: tuple[float, str] | None = None) -> FlightOutcome:
        started, reason = failsafe or (None, "")
        return FlightOutcome(kind, round(time, 9), how, (x, y, z), tilt, speed, commanded, distance, reason, started)

    if diverged:
        return outcome("diverged", end, failure)
    if status is None:
        return outcome("aborted", end, failure) if failure else outcome("completed", end, "no autopilot")
    failsafe = _last_failsafe(status)
    if math.isfinite(accident := first_accident(truth, contacts)):
        return outcome("crashed", accident, "", failsafe)
    over = mission_finished(status) or (failsafe and status.landed[-1] and not status.armed[-1])
    fault = _not_resting(truth, status, cosine) if over else ""
    at_rest = over and not fault
    if failure and not (failure == ENDED and at_rest):
        return outcome("aborted", end, failure, failsafe)
    grounded = touches and touches[0].start == 0 and end - truth.times[min(touches[0].stop, len(truth) - 1)] < BOUNCE
    if grounded and (mission is not None or not over or (at_rest and not failsafe)):
        unarmed = _unarmed(status)
        tried = float(status.armed.mean()) * end > TRYING if "armed" in status.fields else True
        if mission is not None and (tried or failsafe or not mission.is_longer):
            return outcome("timed out", end, ": ".join(filter(None, (NEVER_LEFT, unarmed))), failsafe)
        reason = f"no mission{', ' * bool(unarmed)}{unarmed}" if mission is None else mission.completion(status)
        result = outcome("completed", end, f"{NEVER_LEFT}: {reason}", failsafe)
        return result._replace(causes=(Incident(result.time, NEVER_LEFT),))
    if not over:
        completion = "no mission" if mission is None else mission.completion(status)
        if completion and not failsafe:
            return outcome("completed", end, completion)
        return outcome("timed out", end, _unfinished_outcome(status, failsafe), failsafe)
    if fault:
        return outcome("crashed", end, fault, failsafe)
    # the last touch before the motors stopped; without contact information, the end
    time = float(truth.times[touches[-1].start]) if touches and not grounded else end
    landing = f"upright on its feet, {_touchdown_text(hardest, commanded)}" if hardest else ""
    how = list(filter(None, [NEVER_LEFT if grounded else landing]))
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


def commanded_descent(setpoint: TopicView | None, time: float) -> float | None:
    """Return the largest descent speed [m/s] of the setpoint just before a time [s]; None without one."""
    if setpoint is None or "velocity" not in setpoint.fields:
        return None
    down = -setpoint.velocity[(setpoint.times > time - COMMANDED_TIME) & (setpoint.times <= time), 2]
    return max(0.0, float(down.max())) if len(down) and np.isfinite(down).all() else None


def _harder(commanded: float | None) -> float:
    """Return the speed [m/s] above which a touch is harder than commanded."""
    return HARD if commanded is None else min(HARD, max(HARDER * commanded, SOFT))


def _touchdown_text(touch: Touch, commanded: float | None) -> str:
    """Return the speed of a touch, that commanded, and whether it was harder; on a roof also its name."""
    place = f" on {touch.body}" if touch.face else ""
    text = f"touched down{place} at {round(touch.speed, 2) + 0.0:.2f} m/s"
    if commanded is None:
        return text
    harder = ", harder than commanded" if touch.speed > _harder(commanded) else ""
    return f"{text} (commanded {commanded:.2f}){harder}"


def first_accident(truth: TopicView, contacts: Sequence[Touch]) -> float:
    """Return the time [s] at which the vehicle first turned over or had a crash; infinity without that."""
    rows = [int(row) for row in np.flatnonzero(truth.tilt_cosine < UPSIDE)[:1]]
    rows += [touch.start for touch in contacts if touch.crashes]
    return float(truth.times[min(rows)]) if rows else math.inf


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


def _unarmed(status: TopicView) -> str:
    """Return that the motors were never armed, and what the autopilot reported against it; "" if they were."""
    if "armed" not in status.fields or status.armed.any():
        return ""
    blockers = list(status.arming_blockers[-1]) if "arming_blockers" in status.fields else []
    return ": ".join(["the motors were never armed", *filter(None, ("; ".join(map(str, blockers)),))])


def _unfinished_outcome(status: TopicView, failsafe: tuple[float, str] | None) -> str:
    if not ("armed" in status.fields and status.armed.any()):
        return "mission not finished, motors never armed"
    mode = " ".join(filter(None, (str(status.mode[-1]), f"({status.phase[-1]})" if status.phase[-1] else "")))
    where = f", in {mode}" if mode else ""  # a firmware may not have reported its mode
    return f"mission not finished{where}{_failsafe_text(failsafe)}"


def _failsafe_text(failsafe: tuple[float, str] | None) -> str:
    return f", {failsafe[1]} at {failsafe[0]:.2f} s" if failsafe else ""
