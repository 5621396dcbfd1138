"""Compiled controller block: estimate and setpoint in, motor command and status out."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline, math, python_function
from lapwing.kernels.cell import read
from lapwing.services.autopilot import control, motor_failure
from lapwing.services.autopilot.commander_wakeup import battery_warning
from lapwing.services.autopilot.land_detector import FLYING, LANDED, ON_GROUND
from lapwing.services.autopilot.mixer import clamp_to_range, scale_all, zero_thrust
from lapwing.services.autopilot.motor import thrust_at
from lapwing.services.common.ports import AutopilotStatus, BatteryReading, MotorCommand, Setpoint, StateEstimate

ORDER, FLIGHT = "order", "flight"  # ports within the autopilot
NO_TRAJECTORY = "no_trajectory"  # placeholder of the trajectory's port; never written
NO_READING = BatteryReading(math.nan, math.inf)  # unknown charge, any voltage


class ControllerInput(NamedTuple):
    """Controller input from the commander, latched."""

    follow: bool = True  # the scene's trajectory, instead of `setpoint`
    setpoint: Setpoint = Setpoint()
    status_text_id: int = 0  # index of the commander's status texts
    armed: bool = False
    finished: bool = False  # the run may end
    released: bool = False  # open the gripper
    restart_at: int = -1  # [tick] of a controller reset on the ground


class Flight(NamedTuple):
    """State of the flight after a tick."""

    landed_state: int = ON_GROUND  # ON_GROUND, FLYING or LANDED
    still_from: int = 0  # [tick] from which a vehicle on the ground is at rest
    failed_motor: int = 0  # number of the failed motor, from 1; 0: none


class Controller(NamedTuple):
    """Parameters of the block."""

    law: Any  # cell of `control.Parameters`
    failure_detector: Any  # cell of `motor_failure.Parameters`
    thresholds: Any  # cell of `BatteryThresholds`
    interval: float  # [s] length of a tick
    bounce: int  # [ticks] of possible motion after a touch-down


class ControllerState(NamedTuple):
    """State of the block."""

    control: control.State
    failure_detector: motor_failure.State
    still_from: int  # [tick]
    battery: BatteryReading


def start(p: Controller) -> ControllerState:
    """Return the initial state."""
    return ControllerState(control.START, python_function(motor_failure.start)(read(p.failure_detector)), 0, NO_READING)


class StepStart(NamedTuple):
    """Inputs of a controller's step, and state common to all controllers after a possible reset."""

    estimate: StateEstimate
    order: ControllerInput
    setpoint: Setpoint
    landed_state: int  # ON_GROUND, FLYING or LANDED
    flying: bool
    power: float  # fraction of the commanded thrust that the motors get
    restarts: bool  # the controller is reset at this tick
    failure_detector: motor_failure.State
    still_from: int  # [tick]
    battery: BatteryReading


@always_inline
def start_step(p: Controller, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> StepStart:
    """Read the inputs at `tick`; `s` is the state of a controller block."""
    order, battery, landing = inputs[1].value, inputs[2], inputs[3].value
    restarts = order.restart_at == tick
    detector, still_from = s.failure_detector, s.still_from
    if restarts:
        detector, still_from = motor_failure.start(p.failure_detector.value), tick + p.bounce
    state = landing.landed_state
    return StepStart(
        inputs[0].value, order, landing.setpoint, state, state == FLYING, landing.power,
        restarts, detector, still_from, battery.value if battery.due else s.battery,
    )  # fmt: skip


@always_inline
def motors_off(law: control.Parameters, setpoint: Setpoint) -> control.Command:
    """Return the command that stops the motors."""
    off = zero_thrust(law.shares[0])
    return control.Command(off, off, 0.0, 0.0, setpoint.yaw)


@always_inline
def block_outputs(
    p: Controller, i: StepStart, c: control.Command
) -> tuple[motor_failure.State, tuple[MotorCommand, Setpoint, AutopilotStatus, Flight]]:
    """Return the new state of the motor failure detector and the outputs of the block.

    Args:
        p: parameters of the block.
        i: start of the step.
        c: output of the control law.
    """
    order, setpoint = i.order, i.setpoint
    height = i.estimate.position_world[2] - p.law.value.resting_height
    thrust, voltage = c.thrust, c.motor_voltage
    if i.power < 1.0:
        thrust, voltage = scale_all(i.power, thrust), scale_all(math.sqrt(i.power), voltage)
    reached = clamp_to_range(thrust, thrust_at(p.law.value.motor, i.battery.voltage))
    detector = motor_failure.step(p.failure_detector.value, i.failure_detector, p.interval, i.estimate, height, reached)
    flying = i.flying
    armed = flying if order.follow else order.armed
    finished = (i.landed_state == LANDED and setpoint.final) if order.follow else order.finished
    released = order.released or (order.follow and setpoint.release and not flying)
    attitude_reference = (c.roll_reference, c.pitch_reference, c.yaw_reference)
    warning = battery_warning(p.thresholds.value, i.battery.charge)
    return detector, (
        MotorCommand(voltage, flying, thrust, attitude_reference),
        setpoint,
        AutopilotStatus(
            setpoint.phase, order.status_text_id, armed, not flying, finished, warning, detector.failed, released
        ),
        Flight(i.landed_state, i.still_from, detector.failed),
    )


@always_inline
def step(
    p: Controller, s: ControllerState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[ControllerState, tuple, int]:
    """Compute the motor command at `tick`."""
    i = start_step(p, s, tick, inputs)
    control_state, c = control.START, motors_off(p.law.value, i.setpoint)
    if i.flying:
        before, failed = control.START if i.restarts else s.control, i.failure_detector.failed
        control_state, c = control.step(p.law.value, before, p.interval, i.estimate, i.setpoint, failed)
    detector, outputs = block_outputs(p, i, c)
    return ControllerState(control_state, detector, i.still_from, i.battery), outputs, CONTINUE
