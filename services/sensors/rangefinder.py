"""Laser rangefinder: the distance along one ray, in any direction of the body (theory, eq. (3.40))."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le, Lt
from numba import types

from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.dynamics.lie.quaternion import rotate
from lapwing.dynamics.noise import Key
from lapwing.dynamics.terrain import Level, ray
from lapwing.dynamics.vector import ZERO, Vec3, add
from lapwing.dynamics.vehicles.visible_body import distance_to_body
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.codegen import generic, reduce_tuple
from lapwing.messages import Range, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.common.ports import DistanceReading
from lapwing.services.sensors.delay_line import DEPTH, Fault
from lapwing.services.sensors.distance import CHANNELS, FARTHEST, DistanceState, blank, initial_state, measure
from lapwing.services.sensors.sensor_inputs import OtherVehicle, Place, Truth

__all__ = ["CHANNELS", "PRESETS", "READING", "Rangefinder", "blank", "initial", "sample", "to_ground", "topic_encoders"]

SEES_VEHICLES = True


class Rangefinder(NamedTuple):
    """Parameters of a laser rangefinder."""

    azimuth_deg: Annotated[float, Ge(-360), Le(360)] = 0.0  # [deg] of the ray, from body x towards y
    elevation_deg: Annotated[float, Ge(-90), Le(90)] = -90.0  # [deg] of the ray over the body's xy plane; -90: down
    position: Place = ZERO  # [m] body
    noise_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)] one-sided density
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio, one standard deviation
    range_min: Annotated[float, Ge(0)] = 0.0  # [m] smallest measurable distance
    range_max: Annotated[float, Gt(0)] = math.inf  # [m] largest measurable distance
    resolution: Annotated[float, Ge(0)] = 0.0  # [m] step of a reading
    beam_deg: Annotated[float, Ge(0), Lt(90)] = 0.0  # [deg] full angle, published but not modelled
    rate: Annotated[float, Gt(0)] = 50.0  # [Hz] readings a second
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # [samples] delay of a reading
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


READING = DistanceReading()


@always_inline
def _to_level(terrain: Any, origin: Vec3, direction: Vec3) -> float:
    if origin[2] <= 0.0:
        return 0.0
    return origin[2] / -direction[2] if direction[2] < 0.0 else math.inf


@always_inline
def _to_relief(terrain: Any, origin: Vec3, direction: Vec3) -> float:
    return ray(terrain, origin, direction, FARTHEST)


@generic(inline=True)
def to_ground(terrain: types.Type, origin: types.Type, direction: types.Type) -> Any:
    """Return the distance [m] along a unit vector to the ground or an obstacle; inf without an intersection."""
    return _to_level if terrain.instance_class is Level else _to_relief


@always_inline
def _nearest(ray_world: tuple[Vec3, Vec3], distance: float, other: OtherVehicle, same: OtherVehicle) -> float:
    origin, direction = ray_world
    return min(distance, distance_to_body(other.body, other.position_world, other.attitude, origin, direction))


@always_inline
def _distance(p: Rangefinder, truth: Truth) -> float:
    azimuth, elevation = math.radians(p.azimuth_deg), math.radians(p.elevation_deg)
    across = math.cos(elevation)
    direction = (across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation))
    origin = add(truth.position_world, rotate(truth.attitude, p.position))
    ray_world = rotate(truth.attitude, direction)
    ground = to_ground(truth.environment.terrain, origin, ray_world)
    return reduce_tuple(_nearest, (origin, ray_world), ground, truth.others, truth.others)


@kernel
def initial(p: Rangefinder, key: Key, truth: Truth) -> DistanceState:
    """Return the state before the first sample."""
    return initial_state(p, key, _distance(p, truth))


@kernel
def sample(
    p: Rangefinder, s: DistanceState, key: Key, tick: int, truth: Truth
) -> tuple[DistanceState, DistanceReading]:
    """Return the next state and the reading. See `imu.sample` for arguments."""
    return measure(p, s, key, tick, _distance(p, truth))


def _fields(r: DistanceReading, time_ns: np.ndarray) -> Fields:
    """Return the distance; +Inf out of range, -Inf below the minimum, NaN without a reading."""
    distance = np.where(np.asarray(r.valid) != 0.0, r.range, math.nan)
    return {**stamp_columns(time_ns), "range": distance, "variance": r.variance}


def topic_encoders(frame: str, port: Port, instrument: Any) -> list[TopicEncoder]:
    """Return the encoder of the sensor's topic."""
    p: Rangefinder = instrument.sensor

    def message() -> Any:
        return Range(
            header(0, frame),
            radiation_type=Range.INFRARED,
            field_of_view=math.radians(p.beam_deg),
            min_range=p.range_min,
            max_range=p.range_max,
        )

    return [TopicEncoder(topic.RANGEFINDER, port.name, port.period, _fields, message)]


# Garmin, LIDAR-Lite v3 Operation Manual and Technical Specifications, as others quote it (the manual was not
# available): 40 m on a target that reflects 70 %, resolution 1 cm, +-2.5 cm up to 5 m and +-10 cm beyond, mean error at
# most 1 % of the distance, 50 readings a second as delivered, beam of 8 mrad (also PX4's driver). From 5 cm on by
# sellers' lists. Chosen: +-2.5 cm is two deviations of the noise, 1 % two of the scale.
LIDAR_LITE = Rangefinder(
    noise_m_per_sqrt_hz=0.0025, scale_error=5e-3, range_min=0.05, range_max=40.0, resolution=0.01, beam_deg=0.458
)

# Benewake TFmini, SJ-GU-TFmini-T-01: 0.3 to 12 m on a target that reflects 90 %, +-4 cm up to 6 m and +-6 cm up to
# 12 m, steps of 5 mm, receiving half angle 1.15 degrees, 100 readings a second, of which every second one is used.
# Chosen: +-4 cm is two deviations of noise and, at 6 m, of the scale together, in equal shares.
TFMINI = Rangefinder(
    noise_m_per_sqrt_hz=0.0028, scale_error=2.4e-3, range_min=0.3, range_max=12.0, resolution=0.005, beam_deg=2.3
)

PRESETS = {"lidar_lite_v3": LIDAR_LITE, "tfmini": TFMINI, "ideal": Rangefinder()}
