"""Pre-arm checks."""

from lapwing.kernels import math
from lapwing.services.autopilot.commander.commander_input import CommanderInput
from lapwing.services.autopilot.commander.commander_state import State
from lapwing.services.autopilot.estimator import SOURCES
from lapwing.services.common import status_texts
from lapwing.services.common.plans.fence import OUTSIDE

NOT_STARTED = 0xFF  # health of the estimate before the filter has started
MAXIMUM_TILT = 0.35  # [rad] from the vertical
MAXIMUM_OUTAGE = 0.5  # [s] of a source; single readings may be rejected
_REQUIREMENTS = {"magnetometer": "SYS_HAS_MAG", "barometer": "SYS_HAS_BARO", "sonar": "SYS_HAS_NUM_DIST"}
"""Parameter of each source that arming can do without, as in PX4: 0 skips the check."""
_UNCERTAIN = {64: status_texts.POSITION_UNCERTAIN, 128: status_texts.ATTITUDE_UNCERTAIN}


def count_outages(view: CommanderInput, state: State) -> None:
    """Update the time for which each source has been lost or rejected."""
    health, interval = view.estimate.health, view.estimate_interval
    state.source_outage = [t + interval if health >> bit & 1 else 0.0 for bit, t in enumerate(state.source_outage)]


def arming_blockers(view: CommanderInput, state: State) -> list[str]:
    """Return the texts of all arming blockers, empty if the vehicle can be armed."""
    estimate, guidance = view.estimate, state.guidance
    if estimate.health == NOT_STARTED:
        return [status_texts.NOT_STARTED]
    bad = (name for name, time in zip(SOURCES, state.source_outage, strict=True) if time > MAXIMUM_OUTAGE)
    required = (name for name in bad if guidance.parameters.get(_REQUIREMENTS.get(name, ""), 1.0))  # as in former logs
    blockers = [status_texts.NO_READINGS.format(name) for name in required]
    blockers += [text for bit, text in _UNCERTAIN.items() if estimate.health & bit]
    q = estimate.attitude
    if 1.0 - 2.0 * (q.x * q.x + q.y * q.y) < math.cos(MAXIMUM_TILT):
        blockers.append(status_texts.NOT_LEVEL)
    if view.battery_charge < guidance.parameters["BAT_CRIT_THR"]:
        blockers.append(f"{status_texts.BATTERY_LOW}: {view.battery_charge:.0%}")
    if breach := guidance.fence.breach(*estimate.position_world[:2]):
        blockers.append(status_texts.OUTSIDE_FENCE if breach == OUTSIDE else status_texts.IN_KEEP_OUT)
    return blockers
