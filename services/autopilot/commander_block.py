"""Commander as an event-driven Python block.

It runs at every tick while it generates setpoints. Along the scene's trajectory it runs only at ticks at which its
output may change (`commander.wakeup_conditions`).
"""

from collections.abc import Callable, Iterable
from typing import Any

from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram, Service
from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.kernels import math
from lapwing.kernels.cell import Cell, read, write
from lapwing.messages import CommandAcks, header
from lapwing.messages import topics as topic
from lapwing.services.autopilot import land_detector, motor_failure
from lapwing.services.autopilot.allocation import tables_for_failures
from lapwing.services.autopilot.block import FLIGHT, NO_TRAJECTORY, ORDER, ControllerInput, Flight
from lapwing.services.autopilot.commander.commander import Commander
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.commander_output import CommanderOutput, Status
from lapwing.services.autopilot.commander.wakeup_conditions import battery_thresholds
from lapwing.services.autopilot.commander_wakeup import ESTIMATE_POLL_TICKS
from lapwing.services.autopilot.controller_parameters import build, lift
from lapwing.services.autopilot.failure_injection.injection_blocks import Injection
from lapwing.services.autopilot.failure_injection.motor_failures import DirectMotorControl
from lapwing.services.autopilot.land_detector import LANDED, ON_GROUND
from lapwing.services.autopilot.landing_block import LANDING, Landing
from lapwing.services.autopilot.mixer import airmode
from lapwing.services.autopilot.service_config import AutopilotConfig
from lapwing.services.common import ports
from lapwing.services.common.autopilot_parameters import with_gains
from lapwing.services.common.failure_types import SOUND
from lapwing.services.common.operator_inbox import merge_commands
from lapwing.services.common.ports import ImuSelection, Setpoint
from lapwing.services.common.text_table import TextTable

Operator = Callable[[int], Iterable[Any]]


class CommanderBlock:
    """Runs the commander and writes its output to the port of the controller."""

    name = "autopilot.commander"

    def __init__(
        self,
        config: AutopilotConfig,
        law: Cell,
        thresholds: Cell,
        detector: Cell,
        service: Service,
        operator: Operator,
        injection: Injection,
        landing: Cell,
    ):
        """Create the block.

        Args:
            config: configuration of the autopilot.
            law: cell of the controller's parameters.
            thresholds: cell of the battery thresholds.
            detector: cell of the motor failure detector's parameters.
            service: receiver of the messages.
            operator: source of operator commands.
            injection: failure injection.
            landing: cell of the land detector's parameters.
        """
        self._detector, self._landing = detector, landing
        no_trajectory = () if config.phases else (Port(NO_TRAJECTORY, Setpoint(), LATCHED),)
        self.outputs = (Port(ORDER, ControllerInput(), LATCHED), *no_trajectory)
        a = config.airframe
        self._config, self._law, self._thresholds = config, law, thresholds
        self._service, self._operator = service, operator
        self._weight = a.mass * a.gravity  # [N]
        self._lift = lift(a) / len(a.rotor_x)  # vertical force for 1 N of thrust of each rotor
        table = {p.name: p for p in config.parameters}
        thrust_max = controller(config, {name: p.default for name, p in table.items()}).thrust_max
        hover_thrust = self._weight / (lift(a) * thrust_max)
        constants = Constants(
            table, a.resting_height, a.gravity, hover_thrust, bool(config.phases), config.operator, injection.units,
            len(a.rotor_x), config.imus, config.has_gps, config.height_known,
        )  # fmt: skip
        self._commander = Commander(constants)
        self._injection = injection
        self._motor_failures = (SOUND,) * len(a.rotor_x)  # injected ones
        self._battery = injection.received(ports.BATTERY)
        self.phases = TextTable(config.phases)
        self.status_texts = TextTable([_status_fields(self._commander.initial_status())])
        self._direct_voltages: tuple[float, ...] | None = None  # direct motor voltages in use
        self._last_step = -1  # [tick] of the commander's last step
        self._estimate: Any = None  # last estimate passed to the commander
        self._estimate_tick = -1  # [tick] of that estimate
        self._estimate_every_tick = False
        self._last_order: ControllerInput | None = None  # last value of the port
        self._acknowledgements: list[Any] = []
        self._texts: list[str] = []

    def bind(self, diagram: BlockDiagram) -> None:
        """Store the diagram."""
        self._diagram = diagram
        self._interval, self._interval_ns = diagram.config.interval, diagram.config.interval_ns

    def on_tick(self, tick: int) -> int:
        """Step the commander at `tick`. Return the tick of the next wake-up."""
        diagram = self._diagram
        if self._config.operator and tick - self._last_step > 1:
            self._skip(range(self._last_step + 1, tick))
        self._last_step = tick
        elapsed = 0.0
        estimate_tick = tick - tick % ESTIMATE_POLL_TICKS
        if tick == estimate_tick or self._estimate_every_tick:
            elapsed = self._interval * (1 if self._estimate_every_tick else ESTIMATE_POLL_TICKS)
            estimate_tick = tick
        if estimate_tick > self._estimate_tick:
            self._estimate, self._estimate_tick = diagram.latest(ports.ESTIMATE, estimate_tick), estimate_tick
        flight = self._flight(tick)
        reference = self._reference(tick) if self._config.phases else None
        output = self._commander.step(
            CommanderInput(
                self._interval,
                self._estimate,
                elapsed,
                diagram.latest(self._battery, tick).charge if diagram.has(self._battery) else math.nan,
                flight.failed_motor,
                reference,
                self._thrust(tick),
                flight.landed_state == LANDED,
                self._imu_selection(tick),
                self._commands(tick),
            )
        )
        self._estimate_every_tick = output.estimate_every_tick
        if output.parameters is not None:
            write(self._law, controller(self._config, dict(output.parameters)))
            write(self._thresholds, battery_thresholds(output.parameters))
            detector = motor_failure.build(self._config.airframe, self._config.gyro_range, output.parameters)
            write(self._detector, detector)
            write(self._landing, landing_parameters(self._config, dict(output.parameters)))
        if output.faults is not None and self._injection.faults is not None:
            write(self._injection.faults, output.faults)
            self._forget_failed_motor(output.faults.motors, flight.failed_motor)
        if self._injection.direct is not None and output.motor_voltage != self._direct_voltages:
            self._direct_voltages = output.motor_voltage
            write(self._injection.direct, self._direct(output.motor_voltage))
        order = self._order(tick, output, flight)
        if order != self._last_order:
            diagram.put(ORDER, tick, order)
            self._last_order = order
        self._publish_acknowledgements(tick, output)
        return self._next_wakeup(tick, output.valid_for)

    def _next_wakeup(self, tick: int, valid_for: float) -> int:
        """Return the tick of the next wake-up after an output at `tick` that stays valid for `valid_for` [s]."""
        ticks = int(valid_for / self._interval) if valid_for < math.inf else NEVER
        if self._config.operator:
            ticks = min(ticks, *[every - tick % every for every in (ESTIMATE_POLL_TICKS, self._config.answers_every)])
        return min(tick + max(1, ticks), NEVER)

    def _skip(self, skipped: range) -> None:
        """Advance the commander over ticks at which its output stayed valid."""
        last_flying = next((tick for tick in reversed(skipped) if self._is_flying(tick)), None)
        setpoint = None if last_flying is None else self._reference(last_flying)
        self._commander.skip(len(skipped), self._interval, last_flying == skipped[-1], setpoint)

    def _is_flying(self, tick: int) -> bool:
        """Return True if the vehicle flies along the trajectory."""
        return self._thrust(tick) > 0.0 and self._flight(tick).landed_state != LANDED

    def _flight(self, tick: int) -> Flight:
        flight: Flight = self._diagram.latest(FLIGHT, tick - 1) if tick > 0 else Flight()
        return flight

    def _forget_failed_motor(self, failures: tuple[int, ...], failed: int) -> None:
        """Make the detector forget a failed motor whose injected failure has ended, until the next injection."""
        before, self._motor_failures = self._motor_failures, failures
        ended = failed > 0 and before[failed - 1] != SOUND and failures[failed - 1] == SOUND
        write(self._detector, read(self._detector)._replace(repaired=failed if ended else 0))

    def _imu_selection(self, tick: int) -> ImuSelection:
        voted = self._config.imus > 1 and tick > 0
        return self._diagram.latest(ports.IMU_SELECTION, tick - 1) if voted else ImuSelection()

    def _reference(self, tick: int) -> Setpoint:
        """Return the trajectory's setpoint, or that of the final approach."""
        setpoint: Setpoint = self._diagram.latest(ports.TRAJECTORY, tick)
        landing = self._diagram.latest(LANDING, tick - 1) if tick > 0 else Landing()
        return landing.setpoint if landing.approaches else setpoint

    def _direct(self, volts: tuple[float, ...] | None) -> DirectMotorControl:
        """Return the direct motor voltages within the motors' range; None: the controller's voltages."""
        if volts is None:
            return self._injection.released
        return DirectMotorControl(True, tuple(min(max(v, 0.0), self._config.airframe.voltage_max) for v in volts))

    def _thrust(self, tick: int) -> float:
        """Return the last thrust command over the hover thrust; 1 without gravity."""
        if not self._weight > 0.0:
            return 1.0
        thrust = math.total(self._diagram.latest(ports.ACTUATORS, tick - 1).thrust) if tick > 0 else 0.0
        return thrust * self._lift / self._weight

    def _commands(self, tick: int) -> tuple[Any, ...]:
        config = self._config
        if not config.operator or tick % config.answers_every:
            return ()
        message = merge_commands(tick * self._interval_ns, self._operator(tick))
        self._service.messages.append((topic.OPERATOR, tick, message.encode()))
        return tuple(message.commands)

    def _order(self, tick: int, output: CommanderOutput, flight: Flight) -> ControllerInput:
        status, setpoint = output.status, output.setpoint
        restart = tick if output.reset_controller and flight.landed_state != ON_GROUND else -1
        status_text_id = self.status_texts.number(_status_fields(status))
        if setpoint is None:
            return ControllerInput(True, Setpoint(), status_text_id, False, False, status.released, restart)
        setpoint = setpoint._replace(phase=self.phases.number(status.phase), final=False, release=False)
        return ControllerInput(False, setpoint, status_text_id, status.armed, status.finished, status.released, restart)

    def _publish_acknowledgements(self, tick: int, output: CommanderOutput) -> None:
        self._acknowledgements += output.acknowledgements
        self._texts += output.texts
        if self._config.operator and tick % self._config.answers_every == 0:
            stamp = header(tick * self._interval_ns, "world")
            message = CommandAcks(stamp, tuple(self._acknowledgements), tuple(self._texts))
            self._service.messages.append((topic.COMMAND_ACKS, tick, message.encode()))
            self._acknowledgements.clear()
            self._texts.clear()


def controller(config: AutopilotConfig, values: dict[str, float]) -> Any:
    """Return the controller's parameters with the commander's parameter `values`."""
    law = build(with_gains(config.gains, values), config.airframe, config.geometric)
    return law._replace(shares=tables_for_failures(law.shares, values), airmode=airmode(values))


def landing_parameters(config: AutopilotConfig, values: dict[str, float]) -> land_detector.Parameters:
    """Return the land detector's parameters with the commander's parameter `values`."""
    a = config.airframe
    hover_thrust = a.mass * a.gravity * len(a.rotor_x) / lift(a)
    return land_detector.build(config.landing, a.resting_height, hover_thrust, a.gravity, values, config.height_known)


def _status_fields(status: Status) -> Status:
    """Return the fields of a status that the port has as a text index."""
    return status._replace(phase="", armed=False, finished=False, battery_warning=0, released=False)
