"""State machine between operator and controller: arming, take-off and landing, flight modes.

It is deterministic: its output depends on its inputs only, and time-outs use simulation time.
"""

from lapwing.dynamics.vector import ZERO, norm, subtract
from lapwing.kernels import math
from lapwing.messages import CommandAck
from lapwing.services.autopilot.commander import failsafes, failure_handlers, plan_handlers, prearm_checks  # noqa: F401 (two declare their handlers)
from lapwing.services.autopilot.commander.command_handlers import handle
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.commander_output import CommanderOutput, OperatorMessages, Status
from lapwing.services.autopilot.commander.commander_state import State, initial
from lapwing.services.autopilot.commander.route import ACTIVE, COMPLETE, NO_MISSION, NOT_STARTED, PAUSED
from lapwing.services.autopilot.commander.smoothing import PositionSmoothing
from lapwing.services.autopilot.commander.transitions import Context, arm, disarm, enter
from lapwing.services.autopilot.commander.wakeup_conditions import battery_thresholds, time_without_changes
from lapwing.services.common import status_texts
from lapwing.services.common.ports import Setpoint, StateEstimate

STOPPED_TIME = 1.0  # [s] at rest with low direct motor voltages, after which the vehicle is on the ground
LOW_THRUST = 0.5  # fraction of the hover thrust below which the vehicle cannot fly
LANDED_SPEED = 0.15  # [m/s]
LYING, LYING_TIME = 0.5, 2.0  # cosine of a tilt that no mode but the free ones commands; [s] until the motors stop
HELD_DISTANCE, HELD_SPEED, HELD_TIME = 5.0, 0.3, 10.0  # [m] from the setpoint, [m/s], [s]: an obstacle holds it
HELD_MODES = ("mission", "goto", "orbit", "return", "land", "takeoff", "hold")
FREE_MODES = ("acro", "stabilized", "offboard")  # with tilts of a pilot or a computer


class Commander:
    """The commander with its state."""

    def __init__(self, constants: Constants, state: State | None = None):
        """Start on the ground, disarmed, or from a state."""
        self.constants = constants
        self.state = state if state is not None else initial(constants)

    def initial_status(self) -> Status:
        """Return the status before the first tick."""
        view = CommanderInput(0.0, StateEstimate(), 0.0, math.nan, 0, None, 0.0, False)
        return status(self.constants, view, self.state)

    def skip(self, ticks: int, dt: float, flying: bool, setpoint: Setpoint | None) -> None:
        """Advance over ticks at which the output stayed valid and `step` was not called.

        Args:
            ticks: number of ticks.
            dt: length of a tick [s].
            flying: the vehicle flew at the last of them.
            setpoint: of the trajectory at the last of them in flight; None without flight.
        """
        guidance = self.state.guidance
        for _ in range(ticks):
            guidance.inputs.age(dt)
        guidance.flying = guidance.armed = flying
        if setpoint is not None:
            guidance.follow(setpoint)

    def step(self, view: CommanderInput) -> CommanderOutput:
        """Return the output of a tick.

        While an output is valid, calls are only needed at wake-ups (`time_without_changes`). With an operator, whose
        commands read `guidance`, call `skip` first.
        """
        constants, state = self.constants, self.state
        context = Context(constants, view, state, OperatorMessages())
        if constants.has_operator:
            prearm_checks.count_outages(view, state)
        for command in view.commands:
            handle(context, command)
        _announce_imu_failures(context)
        state.guidance.inputs.age(view.dt)
        _retry_arming(context)
        setpoint, from_estimate = _setpoint(context)
        volts = state.mode.motor_voltage if state.mode and state.guidance.flying else None
        return CommanderOutput(
            setpoint=setpoint,
            parameters=context.outbox.parameters,
            faults=context.outbox.faults,
            acknowledgements=tuple(context.outbox.acknowledgements),
            texts=tuple(context.outbox.texts),
            reset_controller=volts is not None or (not state.on_trajectory and not state.guidance.flying),
            estimate_every_tick=from_estimate,
            motor_voltage=volts,
            status=status(constants, view, state),
            valid_for=time_without_changes(context),
        )


def _announce_imu_failures(context: Context) -> None:
    """Send a text for each unit that the vote has newly excluded."""
    selection, state = context.view.imu_selection, context.state
    if selection.failed != state.imu_selection.failed:
        for unit in range(1, context.constants.imus + 1):
            if (selection.failed & ~state.imu_selection.failed) >> (unit - 1) & 1:
                context.outbox.send_text(status_texts.IMU_FAILED.format(unit, selection.unit))
        state.imu_selection = selection


def _setpoint(context: Context) -> tuple[Setpoint | None, bool]:
    """Return the setpoint, None for the scene's trajectory, and True if it was computed from the estimate."""
    constants, view, state, _ = context
    guidance = state.guidance
    if state.on_trajectory:
        guidance.flying = guidance.armed = view.thrust > 0.0 and not view.motors_cut
        if guidance.flying:
            assert view.setpoint is not None
            guidance.follow(view.setpoint)
            failsafes.update(context)
        if state.on_trajectory:
            return None, False
        guidance.has_flown = True
    elif guidance.flying:
        failsafes.update(context)
        _detect_crash(context)
        _detect_obstruction(context)
    if guidance.flying:
        _detect_landing(context)
    _end_fall(context)
    _disarm_when_idle(context)
    mode = state.mode
    assert mode is not None
    from_estimate = mode.step(constants, view, guidance)
    if mode.next_mode:
        enter(constants, state, mode.next_mode)
    if from_estimate is not None:
        return from_estimate, True
    if guidance.flying:
        return guidance.smoothing.setpoint, False
    x, y, _ = guidance.smoothing.position
    return Setpoint((x, y, constants.resting_height), ZERO, ZERO, guidance.smoothing.yaw, 0.0), False


def _detect_landing(context: Context) -> None:
    """Follow the land detector. It does not see direct motor voltages: with them, detect rest at low thrust."""
    view, state, guidance = context.view, context.state, context.state.guidance
    direct = state.mode is not None and state.mode.motor_voltage is not None
    still = abs(view.estimate.velocity_world[2]) < LANDED_SPEED
    stopped = direct and guidance.smoothing.velocity[2] < -0.2 and still and view.thrust < LOW_THRUST
    state.stopped_time = state.stopped_time + view.dt if stopped else 0.0
    if view.motors_cut or state.stopped_time > STOPPED_TIME:
        guidance.flying, state.on_ground_time, state.stopped_time = False, 0.0, 0.0
        context.outbox.send_text(status_texts.LANDED)


def _detect_crash(context: Context) -> None:
    """Stop the motors of a vehicle that lies on its side or back: nothing else would end its flight."""
    view, state = context.view, context.state
    q = view.estimate.attitude
    lies = 1.0 - 2.0 * (q.x * q.x + q.y * q.y) < LYING and state.mode_name not in FREE_MODES
    state.lying_time = state.lying_time + view.dt if lies else 0.0
    if state.lying_time > LYING_TIME:
        disarm(context, status_texts.TURNED_OVER)


def _detect_obstruction(context: Context) -> None:
    """Land where a vehicle stands still far from its setpoint: something holds it, and the plan cannot be flown."""
    view, state, guidance = context.view, context.state, context.state.guidance
    x, y, _ = subtract(guidance.smoothing.position, view.estimate.position_world)
    vx, vy, _ = view.estimate.velocity_world
    far = math.hypot(x, y) > HELD_DISTANCE and state.mode_name in HELD_MODES and not view.position_lost
    state.held_time = state.held_time + view.dt if far and math.hypot(vx, vy) < HELD_SPEED else 0.0
    if state.held_time > HELD_TIME:
        state.held_time, yaw = 0.0, guidance.smoothing.yaw
        guidance.smoothing = PositionSmoothing(view.estimate.position_world, yaw)
        failsafes.take_over(context, status_texts.HELD, "land")


def _end_fall(context: Context) -> None:
    """Wait until a vehicle whose motors were stopped in flight is at rest."""
    view, state = context.view, context.state
    if state.fall_time < math.inf:
        state.fall_time -= view.dt
        still = norm(view.estimate.velocity_world) < LANDED_SPEED
        state.stopped_time = state.stopped_time + view.dt if still else 0.0
        if state.stopped_time > STOPPED_TIME or state.fall_time < 0.0:
            state.fall_time, state.stopped_time = math.inf, 0.0


def _disarm_when_idle(context: Context) -> None:
    """Disarm after a time-out on the ground."""
    view, state, guidance = context.view, context.state, context.state.guidance
    amid_mission = guidance.has_flown and state.mode_name == "mission" and guidance.route.item is not None
    idle = guidance.armed and not guidance.flying and not amid_mission  # as in PX4: the next item may take off
    state.on_ground_time = state.on_ground_time + view.dt if idle else 0.0
    time_limit = guidance.parameters["COM_DISARM_LAND" if guidance.has_flown else "COM_DISARM_PRFLT"]
    if 0.0 < time_limit < state.on_ground_time:
        disarm(context, status_texts.AFTER_LANDING if guidance.has_flown else status_texts.NO_TAKEOFF)


def _retry_arming(context: Context) -> None:
    """Arm when the checks pass, within the waiting time of the command."""
    view, state, outbox = context.view, context.state, context.outbox
    if state.pending_arm is None:
        return
    command, time_left = state.pending_arm
    blockers = prearm_checks.arming_blockers(view, state)
    if not blockers:
        state.pending_arm = None
        arm(context)
        outbox.acknowledge(command, CommandAck.ACCEPTED)
    elif time_left < view.dt:
        state.pending_arm = None
        outbox.acknowledge(command, CommandAck.TEMPORARILY_REJECTED, blockers[0])
        outbox.send_text(f"Arming denied: {'; '.join(blockers)}")
    else:
        state.pending_arm = state.pending_arm._replace(time_left=time_left - view.dt)


def status(constants: Constants, view: CommanderInput, state: State) -> Status:
    """Return the status after a tick."""
    guidance, route = state.guidance, state.guidance.route
    armed = guidance.armed and not state.on_trajectory
    blockers = prearm_checks.arming_blockers(view, state) if constants.has_operator and not armed else ()
    last_flight = not constants.has_operator or guidance.finish_requested
    return Status(
        mode=state.mode_name,
        phase=state.mode.phase if state.mode else "",
        armed=armed,
        finished=not state.on_trajectory
        and guidance.has_flown
        and not armed
        and last_flight
        and state.fall_time == math.inf,
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
