"""Static pressure error of the barometer in wind of unknown direction (theory, eqs. (3.67) and (3.68))."""

from lapwing.dynamics.atmosphere import share_of_squares
from lapwing.dynamics.effects._turbulence import HIGHEST, LOWEST, SLOWEST, intensity
from lapwing.dynamics.lie.quaternion import rotate_back, rotation_matrix
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import (
    GUST,
    ROW,
    SIZE,
    VARIANCE,
    WIND,
    WIND_SQUARES,
    Memory,
    State,
)

_FIRST_HARMONIC = 8.0 / (3.0 * math.pi)  # of cos x |cos x|


@always_inline
def considers_wind(m: Memory) -> bool:
    """Return True if the filter considers the static pressure error by wind; otherwise its columns are zero."""
    return m.considered[VARIANCE, GUST] != 0.0


@always_inline
def _turbulence(p: Estimator, s: State) -> tuple[float, float, float]:
    """Return the standard deviations of horizontal and vertical gusts [m/s] and their horizontal scale [m]."""
    altitude = min(max(s.nominal.position_world[2] - p.ground_height, LOWEST), HIGHEST)
    sigma, scale = intensity(p.wind_speed, altitude)
    return sigma[0], sigma[2], scale[0]


@kernel
def static_pressure_height(p: Estimator, s: State) -> float:
    """Return the height error [m] by the own motion through still air, and write the row of the effect of wind.

    The expected wind has a known speed W and an unknown direction. With the velocity v and gusts u, the error is
    quadratic in the airspeed v - W - u. Its part by W alone at a fixed heading belongs to the barometer's bias.
    What changes with velocity and heading is linear in W and in (W_x^2 - W_y^2, 2 W_x W_y), which are considered
    constants. The gusts are a first-order process of unit variance with the factor of the expected deviation.

    Args:
        p: `Estimator`.
        s: `State`; its row is changed in place.
    """
    forward, backward, right, left, vertical = p.static_pressure_error
    n, k = s.nominal, s.memory.considered
    velocity = x, y, z = rotate_back(n.attitude, n.velocity_world)
    height = -0.5 * share_of_squares(p.static_pressure_error, velocity) / p.gravity
    if considers_wind(s.memory):
        mean_x, mean_y = 0.5 * (forward + backward), 0.5 * (right + left)
        mean, difference = 0.5 * (mean_x + mean_y), 0.5 * (mean_x - mean_y)
        r = rotation_matrix(n.attitude)
        norm = math.hypot(r[0], r[3])
        c, d = r[0] / norm, r[3] / norm  # cosine and sine of the heading
        sided = 0.5 * _FIRST_HARMONIC * p.wind_speed
        by_x = mean_x * x + sided * 0.5 * (forward - backward)
        by_y = mean_y * y + sided * 0.5 * (left - right)
        k[ROW, WIND] = (c * by_x - d * by_y) / p.gravity
        k[ROW, WIND + 1] = (d * by_x + c * by_y) / p.gravity
        k[ROW, WIND_SQUARES] = -0.5 * difference * (c * c - d * d) / p.gravity
        k[ROW, WIND_SQUARES + 1] = -difference * c * d / p.gravity
        horizontal, upward, _ = _turbulence(p, s)
        square = horizontal * horizontal
        variance = (mean * mean + difference * difference) * square * (
            p.wind_speed * p.wind_speed + x * x + y * y + square
        ) + vertical * vertical * upward * upward * (z * z + 0.5 * upward * upward)
        k[ROW, GUST] = math.sqrt(variance) / p.gravity
    return height


@always_inline
def decorrelate_gusts(p: Estimator, s: State) -> None:
    """Apply the first-order decay of the gusts, which pass at the airspeed, over an interval."""
    if considers_wind(s.memory):
        x, y, _ = s.nominal.velocity_world
        airspeed = max(math.sqrt(x * x + y * y + p.wind_speed * p.wind_speed), SLOWEST)
        keep = math.exp(-p.interval * airspeed / _turbulence(p, s)[2])
        for i in range(SIZE):
            s.memory.considered[i, GUST] *= keep
