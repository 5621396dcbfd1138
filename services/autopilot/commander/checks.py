"""What must be in order before the motors may be armed, in words for people."""

import math
from typing import TYPE_CHECKING

from services.autopilot.estimator import SOURCES
from services.autopilot.navigation import NOT_STARTED

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

LEVEL = 0.35  # [rad] from the vertical at the most
SINGLE = 0.5  # [s] for which a source may be refused: single readings always are now and then
_UNSURE = {64: "the position is uncertain", 128: "the attitude is uncertain"}


def reasons(pilot: "Pilot") -> list[str]:
    """Why the vehicle cannot be armed; empty: it can."""
    if pilot.estimate is None or pilot.health == NOT_STARTED:
        return ["the estimator has not started"]
    bad = (name for name, time in zip(SOURCES, pilot.refusing, strict=True) if time > SINGLE)
    found = [f"no good readings of the {name}" for name in bad]
    found += [text for bit, text in _UNSURE.items() if pilot.health & bit]
    q = pilot.estimate.attitude
    if 1.0 - 2.0 * (q.x * q.x + q.y * q.y) < math.cos(LEVEL):
        found.append("the vehicle does not stand level")
    if pilot.charge < pilot.parameters["BAT_CRIT_THR"]:
        found.append(f"the battery is low: {pilot.charge:.0%}")
    if not pilot.fence.allows(*pilot.estimate.position_world[:2]):
        found.append("the vehicle stands outside of the fence")
    return found
