"""Compiled controller block: estimate and setpoint in, motor command and status out."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline, python_function
from lapwing.services.autopilot import control, interface, motor_failure
from lapwing.services.autopilot.commander_wakeup import battery_warning
from lapwing.services.autopilot.land_detector import FLYING, ON_GROUND
from lapwing.services.common.ports import AutopilotStatus, MotorCommand, Reference, StateEstimate

ORDER, FLIGHT = "order", "flight"  # ports within the autopilot
NO_TRAJECTORY = "no_trajectory"  # placeholder of the trajectory's port; never written


class ControllerInput(NamedTuple):
    """Controller input from the commander, latched."""

    follow: bool = True  # the scene's trajectory, instead of `reference`
    reference: Reference = Reference()
    words: int = 0  # index of the commander's status texts
    armed: bool = False
    finished: bool = False  # the run may end
    released: bool = False  # open the gripper
    restart_at: int = -1  # [tick] of a controller reset on the ground


class Flight(NamedTuple):
    """State of the flight after a tick."""

    stage: int = ON_GROUND  # ON_GROUND, FLYING or LANDED
    still_from: int = 0  # [tick] from which a vehicle on the ground is at rest
    failed_motor: int = 0  # number from 1; 0: none


class Controller(NamedTuple):
    """Parameters of the block."""

    law: Any  # cell of `control.Parameters`
    watch: motor_failure.Parameters
    thresholds: Any  # cell of `BatteryThresholds`
    interval: float  # [s] length of a tick
    bounce: int  # [ticks] of possible motion after a touch-down


class ControllerState(NamedTuple):
    """State of the block."""

    control: control.State
    watch: motor_failure.State
    still_from: int  # [tick]
    charge: float  # of the battery, fraction; NaN: unknown


def start(p: Controller) -> ControllerState:
    """Return the initial state."""
    return ControllerState(control.START, python_function(motor_failure.start)(p.watch), 0, float("nan"))


@always_inline
def setpoint_of(wanted: Reference) -> interface.Setpoint:
    """Return the setpoint of the control law."""
    return interface.Setpoint(
        wanted.position_world, wanted.velocity_world, wanted.acceleration_world, wanted.yaw, wanted.yaw_rate
    )


@always_inline
def estimate_of(e: StateEstimate) -> interface.Estimate:
    """Return the estimate for the control law."""
    return interface.Estimate(e.position_world, e.attitude, e.velocity_world, e.omega_body)


@always_inline
def outcome(
    p: Controller,
    watched: motor_failure.State,
    still_from: int,
    battery_charge: float,
    order: ControllerInput,
    e: StateEstimate,
    wanted: Reference,
    stage: int,
    c: interface.Command,
) -> tuple[motor_failure.State, tuple[MotorCommand, Reference, AutopilotStatus, Flight]]:
    """Return the new state of the motor failure detector and the outputs of the block.

    Args:
        p: parameters of the block.
        watched: state of the motor failure detector.
        still_from: [tick].
        battery_charge: fraction.
        order: input from the commander.
        e: state estimate.
        wanted: reference in use.
        stage: ON_GROUND, FLYING or LANDED.
        c: output of the control law.
    """
    height = e.position_world[2] - p.law.value.resting_height
    watched = motor_failure.step(p.watch, watched, p.interval, e.omega_body, height, c.thrust)
    flying = stage == FLYING
    armed = flying if order.follow else order.armed
    finished = (c.finished and wanted.final) if order.follow else order.finished
    released = order.released or (order.follow and wanted.release and not flying)
    attitude_reference = (c.roll_reference, c.pitch_reference, c.yaw_reference)
    warning = battery_warning(p.thresholds.value, battery_charge)
    return watched, (
        MotorCommand(c.motor_voltage, flying, c.thrust, attitude_reference),
        wanted,
        AutopilotStatus(wanted.phase, order.words, armed, not flying, finished, warning, watched.failed, released),
        Flight(stage, still_from, watched.failed),
    )


@always_inline
def step(
    p: Controller, s: ControllerState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[ControllerState, tuple, int]:
    """Compute the motor command at `tick`."""
    e, order, battery = inputs[0].value, inputs[1].value, inputs[2]
    wanted = inputs[3].value if order.follow else order.reference
    controlled, watched, still_from = s.control, s.watch, s.still_from
    if order.restart_at == tick:
        controlled, watched, still_from = control.START, motor_failure.start(p.watch), tick + p.bounce
    charge = battery.value.charge if battery.due else s.charge
    failed = watched.failed
    controlled, c = control.step(p.law.value, controlled, p.interval, estimate_of(e), setpoint_of(wanted), failed)
    watched, outputs = outcome(p, watched, still_from, charge, order, e, wanted, controlled.stage.name, c)
    return ControllerState(controlled, watched, still_from, charge), outputs, CONTINUE
