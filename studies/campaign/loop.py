"""The closed loop as one compiled function: the same kernels on the same numbers as the services, without messages.

Tick by tick it does what the plant, the sensors, the trajectory and the autopilot do in lock step, in their order of
execution, so that its numbers are theirs to the last bit. What a flight needs beyond that (a pilot who takes over in a
failsafe, an operator) is not in it: `studies.campaign.flight` says which scenes it can fly.
"""

import math
import sys
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from dynamics.cell import Cell
from dynamics.kernel import kernel
from dynamics.vector import norm
from services.autopilot import navigation
from services.autopilot.estimator import initial as begin
from services.autopilot.service import steer
from services.autopilot.stage import FLYING, STANDING
from services.plant.models import reduced
from services.sensors.truth import Truth
from services.trajectory.piece import evaluate


class SampledSensor(NamedTuple):
    """A sensor in the loop."""

    parameters: Cell
    state: Cell
    key: tuple[int, int]
    every: int  # ticks between two samples
    age: int  # of a reading when it arrives, in IMU ticks


class Carried(NamedTuple):
    """The sensors that the estimator listens to; None where the vehicle does not carry it."""

    imu: Any
    magnetometer: Any
    barometer: Any
    gps: Any
    sonar: Any


class Surroundings(NamedTuple):
    """What the sensors measure apart from the motion."""

    gravity: float  # [m/s^2]
    home: Any
    temperature_celsius: float
    magnetic_field_world: tuple[float, float, float]  # [T]


class Timing(NamedTuple):
    """When things happen, in ticks."""

    loop_delay: int  # until a command acts
    status_every: int
    final_phase: int  # of the trajectory
    last: int  # tick of the run at the latest
    settle: int  # after the mission has ended


def _sample(p, s, key, tick, truth):
    """`sample` of the sensor whose parameters `p` are."""
    raise NotImplementedError("compiled code only")


@overload(_sample)
def _sample_of(p, s, key, tick, truth):
    found = sys.modules[p.instance_class.__module__].sample
    return lambda p, s, key, tick, truth: found(p, s, key, tick, truth)


def _switched_on(p, key, truth):
    """`initial` of the sensor whose parameters `p` are."""
    raise NotImplementedError("compiled code only")


@overload(_switched_on)
def _switched_on_of(p, key, truth):
    found = sys.modules[p.instance_class.__module__].initial
    return lambda p, key, truth: found(p, key, truth)


@kernel
def take(sensor, tick, truth):
    """The reading of a sensor at `tick`."""
    p = sensor.parameters.value
    if tick == 0:
        sensor.state.value = _switched_on(p, sensor.key, truth)
    sensor.state.value, reading = _sample(p, sensor.state.value, sensor.key, tick, truth)
    return reading


@kernel
def read_magnetometer(sensor, tick, truth):
    """(field [T], its variance, whether it is sound, whether there is a reading at `tick`)."""
    nothing = (math.nan, math.nan, math.nan)
    if tick % sensor.every:
        return nothing, 0.0, False, False
    r = take(sensor, tick, truth)
    return (r.field_body if r.valid else nothing), r.variance, r.valid, True


@kernel
def hear_barometer(sensor, p, s, tick, truth, begun):
    """The barometer's reading at `tick`, into the estimate once that has begun."""
    if sensor is not None and tick % sensor.every == 0:
        r = take(sensor, tick, truth)
        if begun:
            navigation.update_barometer(p, s, r.pressure if r.valid else math.nan, r.variance, r.valid)


@kernel
def hear_gps(sensor, p, s, tick, truth, begun):
    """The receiver's: position, then velocity."""
    if tick % sensor.every == 0:
        r = take(sensor, tick, truth)
        if begun:
            navigation.update_gps(
                p, s, r.latitude_deg, r.longitude_deg, r.height, r.position_variance, sensor.age, r.valid
            )
            variance = r.velocity_variance if r.valid else -1.0
            navigation.update_gps_velocity(p, s, r.velocity_world, variance, sensor.age, variance >= 0.0)


@kernel
def hear_sonar(sensor, p, s, tick, truth, begun):
    """The sonar's; its message has single precision."""
    if sensor is not None and tick % sensor.every == 0:
        r = take(sensor, tick, truth)
        if begun:
            distance, variance = float(np.float32(r.range)), float(np.float32(r.variance))
            navigation.update_sonar(p, s, distance if r.valid else math.nan, variance, r.valid)


@kernel
def predicted(sensor, believing, tick, truth, standing, begun, field, heard):
    """The IMU's: begins the estimate where the vehicle stands still, carries it on; whether it has begun."""
    if tick % sensor.every:
        return begun
    p, s, r = believing.parameters, believing.state, take(sensor, tick, truth)
    if not begun:
        still = abs(norm(r.specific_force_body) - believing.gravity) < navigation.STILL * believing.gravity
        if not heard or not still:
            return False
        s.value = begin(p.value, believing.start_world, r.specific_force_body, field)
    omega_variance = r.omega_variance if r.valid else -1.0
    force_variance = r.specific_force_variance if r.valid else -1.0
    valid = omega_variance >= 0.0 and force_variance >= 0.0
    remind = standing and tick % believing.remind_every == 0
    navigation.predict(p, s, r.omega_body, r.specific_force_body, omega_variance, force_variance, valid, remind)
    return True


@kernel
def estimated(carried, believing, tick, truth, standing, begun):
    """The tick of the autopilot's navigation: on the truth where nothing is carried, else on the sensors."""
    p, s = believing.parameters, believing.state
    if carried is None:
        q = truth.attitude
        navigation.believe(
            believing.believed,
            truth.position_world,
            (q.x, q.y, q.z, q.w),
            truth.velocity_world,
            truth.omega_body,
            truth.acceleration_world,
        )
        return True
    field, variance, sound, heard = read_magnetometer(carried.magnetometer, tick, truth)
    begun = predicted(carried.imu, believing, tick, truth, standing, begun, field, heard)
    if begun and heard:
        navigation.update_magnetometer(p, s, field, variance, sound)
    hear_barometer(carried.barometer, p, s, tick, truth, begun)
    hear_gps(carried.gps, p, s, tick, truth, begun)
    hear_sonar(carried.sonar, p, s, tick, truth, begun)
    if begun:
        navigation.tell(p, s, believing.believed)
    return begun


@kernel
def keep(record, tick, motion, observed, believed, setpoint, command, flying):
    """Write a tick's row of the record."""
    q, e = motion.attitude, believed.attitude
    for i in range(3):
        record.position_world[tick, i] = motion.position_world[i]
        record.velocity_world[tick, i] = motion.velocity_world[i]
        record.omega_body[tick, i] = motion.omega_body[i]
        record.setpoint_world[tick, i] = setpoint.position_world[i]
        record.estimated_world[tick, i] = believed.position_world[i]
        record.position_std[tick, i] = believed.position_std[i]
    for i in range(4):
        record.attitude[tick, i] = q[i]
        record.estimated_attitude[tick, i] = e[i]
        record.motor_voltage[tick, i] = command.motor_voltage[i]
    record.setpoint_world[tick, 3] = setpoint.yaw
    record.tilt_reference[tick, 0] = command.roll_reference
    record.tilt_reference[tick, 1] = command.pitch_reference
    power = 0.0
    for i in range(4):
        power += observed.motor_power[i]
    record.power[tick] = power
    record.in_contact[tick] = observed.in_contact
    record.armed[tick] = flying
    record.health[tick] = believed.health


@kernel
def fly(plant, carried, autopilot, trajectory, around, timing, record):
    """Fly from tick 0 to the end of the run, writing the record.

    Args:
        plant: the plant's `Core`.
        carried: `Carried`, or None where the truth is believed.
        autopilot: the autopilot's `Core`.
        trajectory: `services.trajectory.piece.Parameters`.
        around: `Surroundings`.
        timing: `Timing`.
        record: `FlightRecord` of timing.last + 1 rows.

    Returns:
        Ticks flown, whether all numbers stayed finite, whether the mission ended before the run, and the number of a
        motor that the autopilot found to have failed (0: none).
    """
    believing, failed = autopilot.navigation, 0
    off = (0.0, 0.0, 0.0, 0.0)
    before, newest = off, off  # commands of the tick before the last, of the last
    stage, begun, last, over = STANDING, False, timing.last, -1
    for tick in range(timing.last + 1):
        motion, observed, sound = reduced.fly(
            plant.method,
            plant.parameters,
            plant.state,
            plant.key,
            tick,
            newest if timing.loop_delay == 1 else before,
            plant.step,
            plant.steps if tick > 0 else 0,
            plant.interval,
        )
        if not sound:
            return tick, False, False, failed
        if over >= 0 and over + timing.loop_delay == tick:
            last = min(last, tick + timing.settle)
        truth = Truth(
            motion.position_world,
            motion.attitude,
            motion.velocity_world,
            motion.omega_body,
            observed.acceleration_world,
            motion.position_world[2],
            around.gravity,
            around.home,
            around.temperature_celsius,
            around.magnetic_field_world,
        )
        begun = estimated(carried, believing, tick, truth, stage == STANDING, begun)
        wanted = evaluate(trajectory, tick * plant.interval)
        command, stage, failed = steer(
            autopilot.parameters,
            autopilot.state,
            autopilot.watch,
            autopilot.watched,
            plant.interval,
            believing.believed,
            wanted.position_world,
            wanted.velocity_world,
            wanted.acceleration_world,
            wanted.yaw,
            wanted.yaw_rate,
        )
        if tick % timing.status_every == 0 and command.finished and wanted.phase >= timing.final_phase and over < 0:
            over = tick
        before, newest = newest, command.motor_voltage
        keep(record, tick, motion, observed, believing.believed.value, wanted, command, stage == FLYING)
        if tick >= last:
            return tick + 1, True, last < timing.last, failed
    return timing.last + 1, True, False, failed
