"""Compiled exchange of a step with ArduPilot: state message, servo packet, motor outputs."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import InputRing
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, math
from lapwing.services.ardupilot.resolve import LOOP_RATE
from lapwing.services.ardupilot.servo_packet import MAGIC_16, MAGIC_32, PULSE_MAX, throttle
from lapwing.services.ardupilot.state_message import INVALID as NOT_WRITTEN
from lapwing.services.ardupilot.state_message import Extras, VehicleState, write_state
from lapwing.services.common.firmware.channel import Channel, is_from_peer, receive, send
from lapwing.services.common.firmware.exchange import FAILED, INVALID, SEND, WAIT, Shared, call_python, newest, step
from lapwing.services.common.ports import TrueState

__all__ = ["step"]
MARGIN = 1e-9  # [s] added to each step: ArduPilot cuts steps to whole microseconds
SEA_LEVEL_DENSITY = 1.225  # [kg/m^3] of indicated airspeed
_HEAD = 8  # [bytes] before the pulse widths


class Samples(NamedTuple):
    """Rings of the vehicle's ports, and flags of its optional sensors."""

    gravity_world: Vec3  # [m/s^2]
    truth: InputRing
    imu: InputRing
    distance: InputRing
    airspeed: InputRing
    battery: InputRing
    has_imu: bool  # rates and specific force of the IMU, otherwise ground truth
    has_distance: bool
    has_airspeed: bool


class ArduPilotExchange(NamedTuple):
    """Parameters of the exchange."""

    shared: Shared
    samples: Samples
    channel: Channel
    next_count: Any  # (1,) frame count of the next servo packet
    pulses: tuple[float, float]  # [us] of motors at rest and at full throttle


@always_inline
def _specific_force(gravity_world: Vec3, x: TrueState) -> Vec3:
    """Return R^T (a - g) [m/s^2], body, of a true state."""
    a, g = x.acceleration_world, gravity_world
    return quaternion.rotate_back(x.attitude, (a[0] - g[0], a[1] - g[1], a[2] - g[2]))  # type: ignore[no-any-return]


@always_inline
def _vehicle_state(p: Samples, tick: int) -> VehicleState:
    """Return the state of the vehicle: ground truth, or rates and specific force of the IMU."""
    x = newest(p.truth, tick)
    omega, force = x.omega_body, _specific_force(p.gravity_world, x)
    if p.has_imu:
        imu = newest(p.imu, tick)
        omega, force = imu.omega_body, imu.specific_force_body
    return VehicleState(x.position_world, x.velocity_world, x.attitude, omega, force)


@always_inline
def _extras(p: Samples, tick: int) -> Extras:
    """Return the optional fields that the vehicle's sensors fill."""
    distance, airspeed = math.nan, math.nan
    range_reading, pressure_reading = newest(p.distance, tick), newest(p.airspeed, tick)
    if p.has_distance and range_reading.valid:
        distance = range_reading.range
    if p.has_airspeed and pressure_reading.valid:
        airspeed = math.sqrt(2.0 * max(pressure_reading.pressure, 0.0) / SEA_LEVEL_DENSITY)
    battery: Any = newest(p.battery, tick)
    return Extras((distance,), airspeed, battery.voltage, battery.current)


@always_inline
def _unsigned16(data: Any, at: int) -> int:
    """Return the number of two bytes, the lower one first."""
    return int(data[at]) | int(data[at + 1]) << 8


@always_inline
def _is_expected(p: ArduPilotExchange, size: int) -> bool:
    """Return True if the datagram is the next servo packet and valid, so that Python need not check it."""
    data, magic = p.channel.received, _unsigned16(p.channel.received, 0)
    if not ((size == 40 and magic == MAGIC_16) or (size == 72 and magic == MAGIC_32)) or not is_from_peer(p.channel):
        return False
    count = _unsigned16(data, 4) | _unsigned16(data, 6) << 16
    if count != p.next_count[0] or _unsigned16(data, 2) <= LOOP_RATE:
        return False
    longest = 0
    for at in range(_HEAD, size, 2):
        longest = max(longest, _unsigned16(data, at))
    return longest <= PULSE_MAX


@always_inline
def exchange(p: ArduPilotExchange, tick: int) -> int:
    """Answer the last servo packet with the state at `tick`, receive the next. Return 1 if a motor runs, 0, or FAILED.

    The first time is one interval: ArduPilot's clock takes 0 for "not stopped", and would read that of the machine.
    """
    e, c = p.shared, p.channel
    time = (tick + 1) * (e.interval + MARGIN)
    size = write_state(c.sent, time, _vehicle_state(p.samples, tick), _extras(p.samples, tick))
    if size == NOT_WRITTEN:
        call_python(e, tick, INVALID, 0)
        return FAILED
    c.sent_size[0] = size
    if not send(c) and not call_python(e, tick, SEND, 0):
        return FAILED
    size = receive(c)
    if _is_expected(p, size):
        p.next_count[0] += 1
        for k in range(len(e.outputs)):
            e.outputs[k] = throttle(_unsigned16(c.received, _HEAD + 2 * k), p.pulses[0], p.pulses[1])
    elif not call_python(e, tick, WAIT, size):
        return FAILED
    running = 0
    for k in range(len(e.outputs)):
        running = 1 if e.outputs[k] > 0.0 else running
    return running  # a heartbeat comes only once a second
