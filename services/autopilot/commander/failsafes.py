"""What the vehicle does by itself when something is lost: hold, return or land, as the parameters say."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from services.autopilot.estimator.state import GPS
from services.parameters import HOLD, LAND, RETURN

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

_MODES = {HOLD: "hold", RETURN: "return", LAND: "land"}
_RANK = ("hold", "return", "land")  # a failsafe never undoes a stronger one
POSITION_LOST = 64 | 128 | 1 << GPS  # bits of the estimate's health


class Failsafe(NamedTuple):
    """A condition that has to last for a while, and the parameter that says what then happens."""

    reason: str
    lost: Callable[["Pilot"], bool]
    patience: Callable[["Pilot"], float]  # [s]
    action: str  # parameter


FAILSAFES = (
    Failsafe(
        "the position is lost",
        lambda p: bool(p.health & POSITION_LOST),
        lambda p: p.parameters["COM_POS_FS_DELAY"],
        "FS_ESTIMATE_ACT",
    ),
    Failsafe("the battery is low", lambda p: p.charge < p.parameters["BAT_CRIT_THR"], lambda p: 0.5, "FS_BATTERY_ACT"),
    Failsafe(
        "the ground station is lost",
        lambda p: p.linked and p.link_age > p.parameters["COM_DL_LOSS_T"],
        lambda p: 0.0,
        "NAV_DLL_ACT",
    ),
    Failsafe(
        "the offboard setpoints are lost",
        lambda p: p.mode_name == "offboard" and not p.offboard_fresh,
        lambda p: 0.0,
        "FS_OFFBOARD_ACT",
    ),
    Failsafe(
        "the vehicle has left the fence",
        lambda p: not p.fence.allows(*p.estimate.position_world[:2]),
        lambda p: 0.1,
        "FS_FENCE_ACT",
    ),
)


class Failsafes:
    """How long each condition has lasted in this flight, and which have acted."""

    def __init__(self) -> None:
        self._lasted = [0.0] * len(FAILSAFES)
        self._acted = [False] * len(FAILSAFES)

    def watch(self, pilot: "Pilot", dt: float) -> None:
        """Take over where a condition has lasted; each acts once until it is over."""
        for i, failsafe in enumerate(FAILSAFES):
            if not failsafe.lost(pilot):
                self._lasted[i], self._acted[i] = 0.0, False
                continue
            self._lasted[i] += dt
            if self._acted[i] or self._lasted[i] <= failsafe.patience(pilot):
                continue
            self._acted[i] = True
            name = _MODES.get(round(pilot.parameters[failsafe.action]))
            if name is None:
                pilot.say(f"{failsafe.reason}; nothing is to be done")
            elif _rank(pilot) < _RANK.index(name):
                pilot.failsafe = failsafe.reason
                pilot.enter(name)
                pilot.say(f"{failsafe.reason}: {name}")


def _rank(pilot: "Pilot") -> int:
    return _RANK.index(pilot.mode_name) if pilot.mode_name in ("return", "land") else -1
