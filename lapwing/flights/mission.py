"""Mission of a flight: the scene's trajectory or a flight plan, and its target."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.flights.topic_view import TopicView
from lapwing.services.common import status_texts
from lapwing.services.common.firmware.schema import FIRMWARES
from lapwing.services.common.plans.route_checks import ends_in_the_air, has_place
from lapwing.services.trajectory.leader_follower import FollowedPath
from lapwing.services.trajectory.polynomial_piece import Parameters

COMPLETE = 5  # Status.mission_state

Place = tuple[float, float, float]


class Mission(NamedTuple):
    """Target and end of a mission."""

    target: Place | None  # [m] world, position at the end; None if unknown before the flight
    final_phase: str | None = None  # last phase of a trajectory that ends in the air; None if it ends with a landing
    is_longer: bool = False  # True if the run ends before the trajectory
    stays: bool = False  # True for a plan that ends without a landing

    def completion(self, status: TopicView) -> str:
        """Return the reason why a flight that has not landed is complete; "" if it is not."""
        if self.is_longer:
            return "the run ends before its trajectory"
        if self.stays and "mission_state" in status.fields and status.mission_state[-1] == COMPLETE:
            return "plan flown, ends in the air"
        has_phase = "phase" in status.fields and len(status) > 0
        if has_phase and status_texts.HOLDING in str(status.phase[-1]):
            return "held its position until the end, as planned"
        if has_phase and self.final_phase is not None and str(status.phase[-1]) == self.final_phase:
            return "trajectory flown, ends in the air"
        return ""


def mission_of(config: RunConfig, start: np.ndarray) -> Mission | None:
    """Return the mission of one vehicle's run configuration, or None without one.

    Args:
        config: run configuration.
        start: initial position in the world frame, shape (3,) [m].
    """
    flying = next((config.services[name] for name in ("autopilot", *FIRMWARES) if name in config.services), None)
    if flying is None:
        return None
    if items := last_upload(flying.parameters, "mission_upload"):
        rally = [tuple(item.position) for item in last_upload(flying.parameters, "rally_upload")]
        return Mission(_plan_target(items, start, rally), stays=ends_in_the_air(items))
    if "trajectory" not in config.services:
        return None
    trajectory = config.services["trajectory"].parameters
    core = trajectory.core
    follows = isinstance(core, FollowedPath)
    paths = [core.leader.path, core.relative.path] if follows else [core.path]
    if config.duration <= max(map(_last_start, paths)):
        return Mission(None, is_longer=True)
    own = core.relative if follows else core
    ends_in_air = own.final >= len(trajectory.phases) or (
        follows and core.leader.final >= len(core.leader.path.phase_start)
    )
    final_phase = trajectory.phases[-1] if ends_in_air else None
    if follows:
        return Mission(None, final_phase)
    path = core.path
    ends = (float(channel.coefficients[-1][0]) for channel in (path.x, path.y, path.z))
    x, y, z = (origin + end for origin, end in zip(path.origin_world, ends, strict=True))
    return Mission((x, y, z), final_phase)


def _last_start(path: Parameters) -> float:
    """Return the start of the last phase or piece of a path [s]."""
    return max(float(path.phase_start[-1]), *(float(c.start[-1]) for c in (path.x, path.y, path.z, path.yaw)))


def last_upload(autopilot: Any, kind: str) -> tuple[Any, ...]:
    """Return the items of the last upload of a kind in the plan of an autopilot; empty without one."""
    uploads = [command.items for command in getattr(autopilot, "plan", ()) if command.kind == kind]
    return tuple(uploads[-1]) if uploads else ()


def _plan_target(items: tuple[Any, ...], start: np.ndarray, rally: Sequence[Place]) -> Place | None:
    """Return the position of the last item with one [m], world; a "return" goes home or to the nearest rally point."""
    home: Place = (float(start[0]), float(start[1]), float(start[2]))
    here, target = home, None
    for item in items:
        if has_place(item):
            here = target = (float(item.position.x), float(item.position.y), float(item.position.z))
        elif item.action == "set_home":
            place = (float(item.position.x), float(item.position.y), float(item.position.z))
            home = place if np.isfinite(place).all() else here
        elif item.action == "return":
            here = target = min([home, *rally], key=lambda place: math.dist(place[:2], here[:2]))
    return target
