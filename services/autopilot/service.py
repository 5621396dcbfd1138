"""The autopilot as a service: sensors (or the truth) and setpoints in, motor voltages out."""

from collections.abc import Iterator
from typing import Any

from dynamics.cell import Cell, read
from dynamics.effects.rotor_thrust import RotorThrust
from dynamics.kernel import kernel
from dynamics.vehicles.multirotor import STANDARD_DENSITY
from messages import Actuators, Estimate, Point, Pose, Quaternion, Setpoint, Status, Vector3, header
from messages.topics import ACTUATORS, ESTIMATE, SETPOINT, STATUS, Topic
from services.autopilot import control, estimator, gains, interface, navigation
from services.autopilot.config import Autopilot as Config
from services.autopilot.motor import Motor
from services.autopilot.stage import FLYING, STANDING
from services.lockstep import Input
from services.scene import Scene
from services.sections import Exchange, Rates, airframe, gravity, start_height, ticks


def create(scene: Scene) -> "Autopilot | None":
    """The autopilot of the scene's `[autopilot]`; None where there is none."""
    return Autopilot(scene) if scene.has(Config) else None


@kernel
def steer(p, s, dt, believed, position_world, velocity_world, acceleration_world, yaw, yaw_rate):
    """One step of the controller in the cell `s` on the estimate in the cell `believed`; the command and the stage."""
    e = believed.value
    estimate = interface.Estimate(e.position_world, e.attitude, e.velocity_world, e.omega_body)
    setpoint = interface.Setpoint(position_world, velocity_world, acceleration_world, yaw, yaw_rate)
    s.value, command = control.step(p.value, s.value, dt, estimate, setpoint)
    return command, s.value.stage.name


class Autopilot:
    """Estimates, then controls, once a tick."""

    outputs = (ACTUATORS, ESTIMATE, STATUS)

    def __init__(self, scene: Scene):
        config, exchange = scene[Config], scene[Exchange]
        self._navigation = navigation.Truth(scene) if config.estimator == "truth" else navigation.Filter(scene)
        self.inputs = (Input(SETPOINT), *self._navigation.inputs)
        self._interval, self._interval_ns = exchange.interval, exchange.interval_ns
        self._estimate_every = ticks(scene, scene[Rates].estimate, "estimate")
        self._status_every = ticks(scene, scene[Rates].status, "status")
        self._parameters = Cell(gains.build(config.gain_set(scene), known_airframe(scene), config.attitude == "so3"))
        self._state, self._stage = Cell(control.START), STANDING

    def prepare(self) -> None:
        """Compile or load the kernels."""
        self._navigation.prepare()
        self._steer(Cell(control.START), Setpoint())
        read(self._navigation.believed)

    def _steer(self, state: Cell, wanted: Any) -> Any:
        return steer(
            self._parameters,
            state,
            self._interval,
            self._navigation.believed,
            tuple(wanted.position),
            tuple(wanted.velocity),
            tuple(wanted.acceleration),
            wanted.yaw,
            wanted.yaw_rate,
        )

    def step(self, tick: int, setpoint: Setpoint, *measured: Any) -> Iterator[tuple[Topic, Any]]:
        """The command at `tick`."""
        self._navigation.update(tick, self._stage == STANDING, *measured)
        command, self._stage = self._steer(self._state, setpoint)
        time_ns = tick * self._interval_ns
        armed = self._stage == FLYING
        finished = command.finished and setpoint.final
        yield (
            ACTUATORS,
            Actuators(
                header(time_ns, "body"),
                command.motor_voltage,
                armed,
                command.thrust,
                Vector3(command.roll_reference, command.pitch_reference, command.yaw_reference),
            ),
        )
        if tick % self._estimate_every == 0:
            yield ESTIMATE, estimate_message(time_ns, read(self._navigation.believed))
        if tick % self._status_every == 0:
            yield (
                STATUS,
                Status(header(time_ns, "body"), "mission", setpoint.phase, armed, not armed, finished, ""),
            )


def known_airframe(scene: Scene) -> gains.Airframe:
    """What the autopilot is told of the vehicle: nominal numbers, at standard density."""
    frame = airframe(scene)
    propeller = RotorThrust.from_scene({}, frame)
    x, y, _ = zip(*frame.rotors.position, strict=True)
    a, b, c, d = frame.rotors.yaw_sign
    engine = frame.motor
    return gains.Airframe(
        frame.mass.total,
        frame.mass.inertia,
        x,
        y,
        (a, b, c, d),
        propeller.torque_constant / propeller.thrust_constant,
        Motor(
            STANDARD_DENSITY * propeller.thrust_constant, engine.belt_ratio, engine.speed_constant, engine.time_constant
        ),
        engine.max_voltage,
        start_height(scene),
        gravity(scene),
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
