"""The two sources of what the controller believes: the estimator on the sensors, or the truth (the paper's case)."""

from collections.abc import Callable
from typing import Any, NamedTuple

from dynamics.cell import Cell
from dynamics.kernel import kernel
from dynamics.lie.quaternion import NO_ROTATION, Quaternion
from dynamics.vector import ZERO, Vec3, norm
from messages import VehicleState, stamp_ns
from messages.topics import BARO, GPS, GPS_VELOCITY, IMU, MAG, SONAR, TRUTH, Topic
from services.autopilot import estimator, readings
from services.lockstep import Input
from services.scene import Scene
from services.sections import Exchange, gravity, start_height, ticks

NOTHING = estimator.Estimate(ZERO, NO_ROTATION, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0, 0)
"""An estimate at the origin, at rest, without error."""
NOT_STARTED = 0xFF  # health before the estimator has begun
STILL = 0.02  # ratio by which the specific force of a vehicle at rest may differ from gravity
STANDSTILL_EVERY = 10  # ticks between two reminders that the vehicle stands


class Core(NamedTuple):
    """What a compiled closed loop believes with; without parameters and state it is the truth."""

    parameters: Any  # cell of the estimator's, or None
    state: Any  # cell that the estimator's first state goes into, or None
    believed: Cell  # of an `estimator.Estimate`
    gravity: float  # [m/s^2] that the estimator counts on
    start_world: Vec3  # [m] where it begins
    remind_every: int  # ticks between two reminders that the vehicle stands


class Truth:
    """Believes what the plant says."""

    inputs = (Input(TRUTH),)

    def __init__(self, scene: Scene):
        self.believed = Cell(NOTHING)

    @property
    def core(self) -> Core:
        """What a compiled closed loop takes instead of `update`."""
        return Core(None, None, self.believed, 0.0, ZERO, 1)

    def prepare(self) -> None:
        """Compile or load the kernel."""
        self.update(0, True, VehicleState())

    def update(self, tick: int, standing: bool, truth: Any) -> None:
        """Believe the truth at `tick`, without error and without bias."""
        believe(
            self.believed,
            tuple(truth.pose.position),
            tuple(truth.pose.orientation),
            tuple(truth.velocity),
            tuple(truth.angular_velocity),
            tuple(truth.acceleration),
        )


@kernel
def believe(cell, position_world, xyzw, velocity_world, omega_body, acceleration_world):
    """Put an exact estimate into the cell."""
    attitude = Quaternion(xyzw[3], xyzw[0], xyzw[1], xyzw[2])
    cell.value = estimator.Estimate(
        position_world, attitude, velocity_world, omega_body, acceleration_world, ZERO, ZERO, ZERO, ZERO, ZERO, 0, 0
    )


class Filter:
    """Believes what the estimator makes of the sensors."""

    def __init__(self, scene: Scene):
        carried = [name for name in ESTIMATED if name.split()[0] in scene.tables("sensors")]
        self.inputs = (Input(IMU), *[Input(ESTIMATED[name][0]) for name in carried])
        self._updates = [ESTIMATED[name][1:] for name in carried]
        self._magnetometer = carried.index("magnetometer")
        self._interval_ns = scene[Exchange].interval_ns
        self._imu_every = ticks(scene, scene.lookup("sensors.imu.rate"), "sensors.imu.rate")
        receiver = scene.tables("sensors")["gps"].get("preset", "rtk")
        self._p = estimator.PRESETS.get(receiver, estimator.Estimator())._replace(
            interval=scene[Exchange].interval * self._imu_every, gravity=gravity(scene)
        )
        self._position = (0.0, 0.0, start_height(scene))
        self._parameters = Cell(self._p)
        self._state: Cell | None = None
        self.believed = Cell(NOTHING._replace(position_world=self._position, health=NOT_STARTED))

    @property
    def core(self) -> Core:
        """What a compiled closed loop takes instead of `update`."""
        every = STANDSTILL_EVERY * self._imu_every
        return Core(self._parameters, self._any_state(), self.believed, self._p.gravity, self._position, every)

    def _any_state(self) -> Cell:
        """A sound state to be overwritten."""
        up, north = (0.0, 0.0, self._p.gravity), (0.0, 2e-5, -4e-5)
        return Cell(estimator.initial(self._p, self._position, up, north))

    def prepare(self) -> None:
        """Compile or load the kernels, on a state that is thrown away."""
        up, north = (0.0, 0.0, self._p.gravity), (0.0, 2e-5, -4e-5)
        p, s = self._parameters, self._any_state()
        predict(p, s, up, up, 1e-6, 1e-4, True, True)
        update_gps(p, s, 0.0, 0.0, 0.0, (1.0, 1.0, 1.0), 0, False)
        update_gps_velocity(p, s, ZERO, 1.0, 0, False)
        update_magnetometer(p, s, north, 1e-14, False)
        update_barometer(p, s, 101325.0, 1.0, False)
        update_sonar(p, s, 0.35, 1e-4, False)
        tell(p, s, Cell(NOTHING))

    def update(self, tick: int, standing: bool, imu: Any, *others: Any) -> None:
        """Take in the messages that are due at `tick`; the vehicle is known to stand or not."""
        p = self._parameters
        if imu is not None:
            reading = readings.imu(imu)
            if self._state is None:
                self._state = self._begin(reading[1], others[self._magnetometer])
            if self._state is None:
                return
            remind = standing and tick % (STANDSTILL_EVERY * self._imu_every) == 0
            predict(p, self._state, *reading, remind)
        if self._state is None:
            return
        for message, (update, convert) in zip(others, self._updates, strict=True):
            if message is not None:
                age = round((tick * self._interval_ns - stamp_ns(message.header)) / self._interval_ns / self._imu_every)
                update(p, self._state, *convert(message, age))
        tell(p, self._state, self.believed)

    def _begin(self, specific_force: Vec3, magnetic: Any) -> Cell | None:
        """The first state, once the vehicle stands still enough to be levelled and the compass has spoken."""
        still = abs(norm(specific_force) - self._p.gravity) < STILL * self._p.gravity
        if magnetic is None or not still:
            return None
        field, _, _ = readings.magnetometer(magnetic, 0)
        return Cell(estimator.initial(self._p, self._position, specific_force, field))


@kernel
def predict(p, s, omega_body, specific_force_body, omega_variance, force_variance, valid, standing):
    """`estimator.predict` in the cell `s`, and the reminder that the vehicle stands where it does."""
    s.value = estimator.predict(
        p.value, s.value, omega_body, specific_force_body, omega_variance, force_variance, valid
    )
    if standing:
        s.value = estimator.update_standstill(p.value, s.value, omega_variance, force_variance)


@kernel
def update_magnetometer(p, s, field_body, variance, valid):
    """`estimator.update_magnetometer` in the cell `s`."""
    s.value = estimator.update_magnetometer(p.value, s.value, field_body, variance, valid)


@kernel
def update_barometer(p, s, pressure, variance, valid):
    """`estimator.update_barometer` in the cell `s`."""
    s.value = estimator.update_barometer(p.value, s.value, pressure, variance, valid)


@kernel
def update_gps(p, s, latitude_deg, longitude_deg, height, variance, age, valid):
    """`estimator.update_gps` in the cell `s`."""
    s.value = estimator.update_gps(p.value, s.value, latitude_deg, longitude_deg, height, variance, age, valid)


@kernel
def update_gps_velocity(p, s, velocity_world, variance, age, valid):
    """`estimator.update_gps_velocity` in the cell `s`."""
    s.value = estimator.update_gps_velocity(p.value, s.value, velocity_world, variance, age, valid)


@kernel
def update_sonar(p, s, distance, variance, valid):
    """`estimator.update_sonar` in the cell `s`."""
    s.value = estimator.update_sonar(p.value, s.value, distance, variance, valid)


@kernel
def tell(p, s, believed):
    """Put the estimate of the cell `s` into the cell `believed`."""
    believed.value = estimator.estimate(p.value, s.value)


ESTIMATED: dict[str, tuple[Topic, Callable, Callable]] = {
    "magnetometer": (MAG, update_magnetometer, readings.magnetometer),
    "barometer": (BARO, update_barometer, readings.barometer),
    "gps": (GPS, update_gps, readings.gps),
    "gps velocity": (GPS_VELOCITY, update_gps_velocity, readings.gps_velocity),
    "sonar": (SONAR, update_sonar, readings.sonar),
}
"""What the estimator takes in after the IMU, in this order: topic, update, conversion of the message."""
