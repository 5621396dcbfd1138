"""Dryden turbulence at low altitude with angular gusts."""

import zlib
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects import wind_dryden
from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import air, air_rate, discrete_update
from lapwing.dynamics.effects._turbulence import (
    KIND,
    NOT_STARTED,
    Conditions,
    add_to_air,
    advance_filters,
    conditions,
    deviation_and_rate,
    first_order,
    in_world,
    intensity,
    next_line,
    on_line,
    surroundings,
    ticks_per_sample,
    time_to_sample,
)
from lapwing.dynamics.effects._turbulence import Settings as Turbulence
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.noise import normal3
from lapwing.dynamics.vector import ZERO, add, apply_transposed, scale
from lapwing.kernels import always_inline, math

__all__ = ["KIND", "Settings", "WindDrydenRates"]

LANE = zlib.crc32(b"wind_dryden_rates")
FIRST, SECOND = wind_dryden.LANES
ROOT3 = math.sqrt(3.0)
APART = 1e-6  # least difference of the two filters' rates


class Settings(NamedTuple):
    """Scene table."""

    wind_speed: Annotated[float, Gt(0), Le(30)]  # [m/s] mean wind 6 m (20 feet) above the ground
    airspeed: Annotated[float, Gt(0), Le(60)] | None = None  # [m/s] at which gusts pass; if left out, the vehicle's
    altitude: Annotated[float, Ge(3.048), Le(304.8)] | None = None  # [m] above the ground; if left out, the vehicle's
    direction_to: Annotated[float, Ge(-2.0 * math.pi), Le(2.0 * math.pi)] = 0.0  # [rad] of the mean wind, 0 to the east
    span: Annotated[float, Ge(0.05), Le(20)] | None = None  # [m] of the vehicle; smaller gusts do not rotate it


class WindDrydenRates(NamedTuple):
    """Gusts of `wind_dryden`, bit-for-bit identical, and angular rates of the air (theory, eq. (2.39)).

    The rates change the air velocity at the rotor hubs. Source: MIL-F-8785C, section 3.7.5: p has its own filter, q and
    r follow from the passing transverse gusts. Valid and sampled as `wind_dryden`.
    """

    conditions: Conditions
    span: float  # [m]

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "WindDrydenRates":
        """Return the parameters over level ground; the default span is from tip to tip of the outer rotors."""
        span = validate_table(Settings, table).span
        if span is None:
            reach = max(math.hypot(x, y) for x, y, _ in airframe.rotors.position)
            span = 2.0 * reach + (airframe.propeller.diameter if airframe.propeller else 0.0)
        return cls(conditions({key: value for key, value in table.items() if key in Turbulence._fields}), span)

    def in_environment(self, environment: Environment) -> "WindDrydenRates":
        """Return the effect over the scene's terrain."""
        return self._replace(conditions=self.conditions._replace(terrain=environment.terrain))

    def initial_discrete_state(self) -> tuple:
        """Return the state of `wind_dryden`, states of roll, pitch and yaw, and the air's rate with its slope."""
        return (0.0, 0.0, 0.0, 0.0, 0.0), (ZERO, ZERO), NOT_STARTED, (0.0, 0.0, 0.0), (ZERO, ZERO)


@always_inline
def low_pass(x1, x2, z, beta, theta, n1, n2, n3):
    """Return the low-passed transverse gust z, `theta` gust correlation times later (theory, eq. (2.40)).

    Args:
        x1: previous first state of the gust's filter.
        x2: previous second state.
        z: previous value.
        beta: correlation time of the gust over that of the low-pass.
        theta: time over the correlation time of the gust.
        n1: draw of the gust's first state.
        n2: draw of its second state.
        n3: draw of the low-pass.
    """
    k = beta - 1.0
    k = k if abs(k) > APART else APART
    decay, low = math.exp(-theta), math.exp(-beta * theta)
    i0 = (decay - low) / k
    i1 = (theta * decay - i0) / k
    a, b = beta * (ROOT3 * i0 + (1.0 - ROOT3) * i1), beta * (1.0 - ROOT3) * i0  # of x1, of x2
    # stationary covariances, and their increments after that time
    p13 = beta * (0.5 * ROOT3 + 0.25 * (1.0 - ROOT3)) / (1.0 + beta)
    p23 = (p13 + 0.25 * beta) / (1.0 + beta)
    p33 = ROOT3 * p13 + (1.0 - ROOT3) * p23
    mean1, mean2, mean3 = 0.5 * a + 0.25 * b + p13 * low, 0.25 * (a + b) + p23 * low, a * p13 + b * p23 + p33 * low
    q13 = p13 - decay * mean1
    q23 = p23 - decay * (mean2 + theta * mean1)
    q33 = p33 - (a * mean1 + b * mean2 + low * mean3)
    q11 = 0.5 * (1.0 - decay * decay)
    q12 = 0.25 * (1.0 - decay * decay * (1.0 + 2.0 * theta))
    q22 = 0.25 * (1.0 - decay * decay * (1.0 + 2.0 * theta * (1.0 + theta)))
    root = math.sqrt(q11)
    cross = q12 / root
    rest = math.sqrt(max(q22 - cross * cross, 0.0))
    c1 = q13 / root
    c2 = (q23 - cross * c1) / rest if rest > 0.0 else 0.0
    c3 = math.sqrt(max(q33 - c1 * c1 - c2 * c2, 0.0))
    return a * x1 + b * x2 + low * z + c1 * n1 + c2 * n2 + c3 * n3


@discrete_update(WindDrydenRates)
def draw(e, memory, s, rotors, key, tick, interval):
    """Return the filter states, and the wind [m/s, world] and the air's rate [rad/s, world] with their slopes."""
    every = ticks_per_sample(interval)
    last = memory[2]
    started = last >= 0.0
    if started and tick % every != 0:
        return memory
    period, now, number = every * interval, tick * interval, tick // every
    _, across1, across2, up1, up2 = memory[0]
    roll, pitch, yaw = memory[3]
    sigma, rate = deviation_and_rate(e.conditions, s)
    time = time_to_sample(started, rate, period)
    first, second = normal3(key, number, FIRST), normal3(key, number, SECOND)
    third = normal3(key, number, LANE)
    altitude, airspeed = surroundings(e.conditions, s)
    _, length = intensity(e.conditions.wind_speed, altitude)
    per_span = math.pi / (4.0 * e.span)  # [1/m] of roll and pitch; four thirds of it of yaw
    beta_up, beta_across = per_span * length[2], 4.0 / 3.0 * per_span * length[1]
    roll = first_order(roll, per_span * airspeed * time, third[0])
    pitch = low_pass(up1, up2, pitch, beta_up, rate[2] * time, first[2], second[1], third[1])
    yaw = low_pass(across1, across2, yaw, beta_across, rate[1] * time, first[1], second[0], third[2])
    states, (u, v, w) = advance_filters(memory[0], scale(time, rate), first, second)
    wind = in_world(e.conditions, sigma[0] * u, sigma[1] * v, sigma[2] * w)
    p = sigma[2] * math.pi * math.sqrt(0.1 * math.cbrt(per_span * length[2]) / (e.span * length[2])) * roll
    q, r = per_span * sigma[2] * (w - pitch), -4.0 / 3.0 * per_span * sigma[1] * (v - yaw)
    rotation = in_world(e.conditions, p, q, r)
    wind_line = next_line(memory[1], last, now, started, wind, period)
    rate_line = next_line(memory[4], last, now, started, rotation, period)
    return states, wind_line, now, (roll, pitch, yaw), rate_line


@air(WindDrydenRates)
def wind_dryden_rates(e, memory, s, before):
    """Add the turbulence to the air."""
    return add_to_air(memory, s, before)


@air_rate(WindDrydenRates)
def add_gust_rate(e, memory, s, before):
    """Add the turbulence's rate to the air's rate [rad/s], body coordinates."""
    return add(before, apply_transposed(s.R_world_body, on_line(memory[4], s.t - memory[2])))
