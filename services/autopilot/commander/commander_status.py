"""Status of the commander."""

from lapwing.services.autopilot.commander import prearm_checks
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.commander_output import Status
from lapwing.services.autopilot.commander.commander_state import State
from lapwing.services.autopilot.commander.route import ACTIVE, COMPLETE, NO_MISSION, NOT_STARTED, PAUSED
from lapwing.services.autopilot.commander.wakeup_conditions import battery_thresholds


def status(constants: Constants, view: CommanderInput, state: State) -> Status:
    """Return the status after a tick."""
    guidance, route = state.guidance, state.guidance.route
    armed = guidance.armed and not state.on_trajectory
    blockers = prearm_checks.arming_blockers(view, state) if constants.has_operator and not armed else ()
    last_flight = not constants.has_operator or state.finish_requested
    return Status(
        mode=state.mode_name,
        phase=state.mode.phase if state.mode else "",
        armed=armed,
        finished=not state.on_trajectory and guidance.has_flown and not armed and last_flight,
        failsafe=state.failsafe,
        mission_current=min(route.current, max(0, len(route.items) - 1)),
        mission_count=len(route.items),
        mission_reached=route.reached,
        mission_state=mission_state(state),
        offboard_available=guidance.offboard_available,
        arming_blockers=tuple(blockers),
        home=guidance.home,
        released=guidance.released,
        battery_warning=sum(view.battery_charge < limit for limit in battery_thresholds(guidance.parameters)),
    )


def mission_state(state: State) -> int:
    """Return the MISSION_STATE of MAVLink."""
    guidance, route = state.guidance, state.guidance.route
    if not route.items:
        return NO_MISSION
    if route.item is None:
        return COMPLETE
    if state.mode_name == "mission" and guidance.armed and not state.on_trajectory:
        return ACTIVE
    return PAUSED if guidance.flying or route.current > 0 else NOT_STARTED
