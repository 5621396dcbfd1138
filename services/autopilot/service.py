"""The autopilot as a service: sensors (or the truth) and setpoints in, motor voltages out."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from dynamics.cell import Cell, read
from dynamics.effects.rotor_thrust import RotorThrust
from dynamics.kernel import kernel
from dynamics.vector import ZERO
from dynamics.vehicles.multirotor import STANDARD_DENSITY
from messages import Actuators, Answers, Estimate, Point, Pose, Quaternion, Setpoint, Status, Vector3, header
from messages.topics import ACTUATORS, ANSWERS, BATTERY, ESTIMATE, OPERATOR, SETPOINT, STATUS, TRAJECTORY, Topic
from services import parameters
from services.autopilot import control, estimator, gains, interface, motor_watch, navigation
from services.autopilot.commander.checks import reasons
from services.autopilot.commander.orders import obey
from services.autopilot.commander.pilot import Pilot
from services.autopilot.config import Autopilot as Config
from services.autopilot.motor import Motor
from services.autopilot.stage import FLYING, LANDED, STANDING
from services.lockstep import Input
from services.scene import Scene
from services.sections import (
    Effects,
    Exchange,
    Rates,
    airframe,
    follows_trajectory,
    gravity,
    period,
    start_height,
    ticks,
)

LOOK = 5  # ticks between two looks of the pilot at the estimate
BOUNCE = 1.0  # [s] after a touch-down in which the vehicle may still move


def create(scene: Scene) -> "Autopilot | None":
    """The autopilot of the scene's `[autopilot]`; None where there is none."""
    return Autopilot(scene) if scene.has(Config) else None


@kernel
def steer(p, s, watch, watched, dt, believed, position_world, velocity_world, acceleration_world, yaw, yaw_rate):
    """One step of the controller in the cell `s` on the estimate in the cell `believed`.

    Returns the command, the stage, and the number of a motor that has failed (watched in `watched`; 0: none).
    """
    e = believed.value
    estimate = interface.Estimate(e.position_world, e.attitude, e.velocity_world, e.omega_body)
    setpoint = interface.Setpoint(position_world, velocity_world, acceleration_world, yaw, yaw_rate)
    s.value, command = control.step(p.value, s.value, dt, estimate, setpoint)
    height = e.position_world[2] - p.value.resting_height
    watched.value = motor_watch.step(watch.value, watched.value, dt, e.omega_body, height, command.thrust)
    return command, s.value.stage.name, watched.value.failed


class Core(NamedTuple):
    """What a compiled closed loop flies with; there is no pilot in it."""

    navigation: navigation.Core
    parameters: Cell  # of the controller
    state: Cell  # of the controller
    watch: Cell  # parameters of the watch for failing motors
    watched: Cell  # its state


class Autopilot:
    """Estimates, asks the pilot what to do, then controls, once a tick."""

    def __init__(self, scene: Scene):
        config, exchange = scene[Config], scene[Exchange]
        self._navigation = navigation.Truth(scene) if config.estimator == "truth" else navigation.Filter(scene)
        follows = follows_trajectory(scene)
        self._given = Input(TRAJECTORY) if follows else None
        self._operator = Input(OPERATOR, external=True) if config.operator else None
        optional = [needed for needed in (self._given, self._operator) if needed]
        self.inputs = (*optional, Input(BATTERY), *self._navigation.inputs)
        self.outputs: tuple[Topic, ...] = (ACTUATORS, ESTIMATE, STATUS, SETPOINT)
        self.outputs += (ANSWERS,) if config.operator else ()
        self._interval, self._interval_ns = exchange.interval, exchange.interval_ns
        self._estimate_every = ticks(scene, scene[Rates].estimate, "estimate")
        self._status_every = ticks(scene, scene[Rates].status, "status")
        self._answers_every = period(scene, ANSWERS)
        self._gains, self._geometric, self._airframe = (
            config.gain_set(scene),
            config.attitude == "so3",
            known_airframe(scene),
        )
        table = parameters.table(scene)
        built = self._build({p.name: p.default for p in table.values()})
        self._parameters = Cell(built)
        self._watch = Cell(motor_watch.build(self._airframe))
        self._stand()
        self._still_from = 0  # tick from which a vehicle that stands does not move
        self._weight = self._airframe.mass * self._airframe.gravity
        share = self._weight / (4.0 * built.thrust_max)
        self._pilot = Pilot(
            table,
            self._airframe.resting_height,
            self._airframe.gravity,
            share,
            follows,
            config.operator,
        )
        self._thrust = 0.0  # [N] asked for at the last tick

    @property
    def core(self) -> Core:
        """What a compiled closed loop takes instead of `step`."""
        return Core(self._navigation.core, self._parameters, self._state, self._watch, self._watched)

    def prepare(self) -> None:
        """Compile or load the kernels."""
        self._navigation.prepare()
        self._steer(Cell(control.START), Cell(motor_watch.START), interface.Setpoint(ZERO, ZERO, ZERO, 0.0, 0.0))
        read(self._navigation.believed)

    def _stand(self) -> None:
        """The controller before a flight."""
        self._state, self._watched, self._stage = Cell(control.START), Cell(motor_watch.START), STANDING

    def _build(self, values: dict[str, float]) -> control.Parameters:
        """The controller's parameters of the pilot's `values`."""
        return gains.build(parameters.with_gains(self._gains, values), self._airframe, self._geometric)

    def _steer(self, state: Cell, watched: Cell, wanted: Any) -> Any:
        return steer(
            self._parameters,
            state,
            self._watch,
            watched,
            self._interval,
            self._navigation.believed,
            *wanted,
        )

    def step(self, tick: int, *messages: Any) -> Iterator[tuple[Topic, Any]]:
        """The command at `tick`."""
        arrived = iter(messages)
        setpoint = next(arrived) if self._given else None
        commands = next(arrived) if self._operator else None
        battery = next(arrived)
        if battery is not None:
            self._pilot.charge = battery.percentage
        self._navigation.update(tick, self._stage == STANDING and tick >= self._still_from, *arrived)
        wanted = self._ask(tick, setpoint, commands)
        command, self._stage, self._pilot.failed_motor = self._steer(self._state, self._watched, wanted)
        self._thrust = sum(command.thrust)
        yield from self._tell(tick, setpoint, wanted, command)

    def _ask(self, tick: int, setpoint: Any, commands: Any) -> Any:
        """What the pilot wants, having heard the operator."""
        pilot = self._pilot
        if tick % LOOK == 0 or pilot.looks_closely:
            passed = self._interval * (1 if pilot.looks_closely else LOOK)
            pilot.look(read(self._navigation.believed), passed)
        for given in commands.commands if commands else ():
            obey(pilot, given)
        if pilot.parameters_changed:
            pilot.parameters_changed = False
            self._parameters = Cell(self._build(pilot.parameters))
        carried = self._thrust / self._weight if self._weight > 0.0 else 1.0  # without gravity nothing falls
        wanted = pilot.step(self._interval, setpoint, carried, self._stage == LANDED)
        if not pilot.on_trajectory and not pilot.flying and self._stage != STANDING:
            self._stand()
            self._still_from = tick + round(BOUNCE / self._interval)
        return wanted

    def _tell(self, tick: int, setpoint: Any, wanted: Any, command: Any) -> Iterator[tuple[Topic, Any]]:
        """The messages of a tick."""
        time_ns, pilot = tick * self._interval_ns, self._pilot
        flying = self._stage == FLYING
        yield (
            ACTUATORS,
            Actuators(
                header(time_ns, "body"),
                command.motor_voltage,
                flying,
                command.thrust,
                Vector3(command.roll_reference, command.pitch_reference, command.yaw_reference),
            ),
        )
        if tick % self._estimate_every == 0:
            yield ESTIMATE, estimate_message(time_ns, read(self._navigation.believed))
        if pilot.on_trajectory:
            yield SETPOINT, setpoint
        else:
            yield SETPOINT, Setpoint(header(time_ns, "world"), *wanted_vectors(wanted), pilot.phase, False)
        if tick % self._status_every == 0:
            over = command.finished and setpoint.final if pilot.on_trajectory else pilot.finished
            phase = setpoint.phase if pilot.on_trajectory else pilot.phase
            yield STATUS, status_message(time_ns, pilot, phase, flying, over)
        if self._operator and tick % self._answers_every == 0:
            answers, texts = tuple(pilot.answers), tuple(pilot.texts)
            pilot.answers.clear()
            pilot.texts.clear()
            yield ANSWERS, Answers(header(time_ns, "world"), answers, texts)


def wanted_vectors(wanted: interface.Setpoint) -> tuple:
    """A setpoint as the fields of its message."""
    p, v, a, yaw, yaw_rate = wanted
    return Vector3(*p), Vector3(*v), Vector3(*a), yaw, yaw_rate


def status_message(time_ns: int, pilot: Pilot, phase: str, flying: bool, finished: bool) -> Any:
    """What the vehicle is doing, as it is published."""
    armed = flying if pilot.on_trajectory else pilot.armed
    return Status(
        header(time_ns, "body"),
        pilot.mode_name,
        phase,
        armed,
        not flying,
        finished,
        pilot.failsafe,
        pilot.route.current,
        len(pilot.route.items),
        pilot.route.reached,
        pilot.mission_state,
        pilot.offboard_fresh,
        tuple(reasons(pilot)) if pilot.operated and not armed else (),
        bool(pilot.failsafe),
        Vector3(*pilot.home, 0.0),
        pilot.battery_warning,
        pilot.failed_motor,
    )


def known_airframe(scene: Scene) -> gains.Airframe:
    """What the autopilot is told of the vehicle: nominal numbers, at standard density."""
    frame = airframe(scene)
    propeller = RotorThrust.from_scene({}, frame)
    torque_per_thrust = propeller.torque_constant / propeller.thrust_constant
    thrust_coefficient = STANDARD_DENSITY * propeller.thrust_constant
    weight = 0.25 * frame.mass.total * gravity(scene)
    slope = 2.0 * math.sqrt(weight * thrust_coefficient)  # [N s/rad] of a rotor in hover
    spins_up = "rotor_gyro" in scene[Effects].tables and slope > 0.0
    x, y, _ = zip(*frame.rotors.position, strict=True)
    a, b, c, d = frame.rotors.yaw_sign
    engine = frame.motor
    return gains.Airframe(
        frame.mass.total,
        frame.mass.inertia,
        x,
        y,
        (a, b, c, d),
        torque_per_thrust,
        Motor(thrust_coefficient, engine.belt_ratio, engine.speed_constant, engine.time_constant),
        engine.max_voltage,
        start_height(scene),
        gravity(scene),
        frame.rotors.inertia / (slope * torque_per_thrust) if spins_up else 0.0,
    )


def estimate_message(time_ns: int, e: estimator.Estimate) -> Any:
    """The estimate as it is published."""
    q = e.attitude
    return Estimate(
        header(time_ns, "world"),
        Pose(Point(*e.position_world), Quaternion(q.x, q.y, q.z, q.w)),
        *[
            Vector3(*v)
            for v in (
                e.velocity_world,
                e.omega_body,
                e.acceleration_world,
                e.gyro_bias,
                e.accelerometer_bias,
                e.position_std,
                e.velocity_std,
                e.attitude_std,
            )
        ],
        tuple(name for bit, name in enumerate(estimator.SOURCES) if e.rejected >> bit & 1),
        e.health,
    )
