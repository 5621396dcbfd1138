"""What the vehicle does by itself when something is lost: hold, return, land or descend, as the parameters say."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from services.parameters import DESCEND, HOLD, LAND, RETURN

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot

_MODES = {HOLD: "hold", RETURN: "return", LAND: "land", DESCEND: "descend"}
_RANK = ("hold", "return", "land", "descend")  # a failsafe never undoes a stronger one
_WARNING = 1.0  # [s] a condition lasts before the pilot is told what is to come


class Failsafe(NamedTuple):
    """A condition that has to last for a while, and the parameter that says what then happens."""

    reason: str
    lost: Callable[["Pilot"], bool]
    patience: Callable[["Pilot"], float]  # [s]
    action: str  # parameter


def _battery(reason: str, threshold: str, action: str) -> Failsafe:
    return Failsafe(reason, lambda p: p.charge < p.parameters[threshold], lambda p: 0.5, action)


FAILSAFES = (
    Failsafe(
        "the position is lost",
        lambda p: p.position_lost,
        lambda p: p.parameters["COM_POS_FS_DELAY"],
        "FS_ESTIMATE_ACT",
    ),
    Failsafe("a motor has failed", lambda p: p.failed_motor > 0, lambda p: 0.0, "FS_MOTOR_ACT"),
    _battery("the battery is nearly empty", "BAT_EMERGEN_THR", "FS_BAT_EMER_ACT"),
    _battery("the battery is critical", "BAT_CRIT_THR", "FS_BAT_CRIT_ACT"),
    _battery("the battery is low", "BAT_LOW_THR", "FS_BAT_LOW_ACT"),
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
            before = self._lasted[i]
            self._lasted[i] += dt
            if self._acted[i]:
                continue
            patience, name = failsafe.patience(pilot), _MODES.get(round(pilot.parameters[failsafe.action]))
            if self._lasted[i] > patience:
                self._acted[i] = _act(pilot, failsafe.reason, name)
            elif before <= _WARNING < self._lasted[i] and name:
                pilot.say(f"{failsafe.reason}: {name} in {patience - _WARNING:.0f} s")


def _act(pilot: "Pilot", reason: str, name: str | None) -> bool:
    """Do what is to be done; whether that was possible in the present mode."""
    if name is None:
        pilot.say(reason)
        return True
    if name == "descend" and pilot.sticks_fresh:
        name = "altitude_control"  # there is a pilot who sees it: he has it
    elif _rank(pilot) >= _RANK.index(name):
        return False
    pilot.failsafe = reason
    pilot.enter(name)
    pilot.say(f"{reason}: {name}")
    return True


def _rank(pilot: "Pilot") -> int:
    return _RANK.index(pilot.mode_name) if pilot.mode_name in _RANK[1:] else -1
