"""Real-time kinematic solutions of a satellite receiver: single, float, fixed (theory, section 3.2)."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.config_error import ConfigError
from lapwing.kernels import kernel, math
from lapwing.services.common.ports import GPS_FLOAT, GPS_RTK, GPS_SINGLE


class Gap(NamedTuple):
    """Time without corrections of the base station."""

    start: Annotated[float, Ge(0)] = 0.0  # [s] simulation time
    stop: Annotated[float, Ge(0)] = math.inf  # [s] simulation time; default: until the end of the run


class Rtk(NamedTuple):
    """Solutions of the carrier phases; the receiver's correlated errors are those of the fixed one."""

    float_ratio: Annotated[float, Ge(1), Le(1e5)] = 30.0  # correlated errors over those of the fixed solution
    single_ratio: Annotated[float, Ge(1), Le(1e5)] = 150.0  # correlated errors without corrections over the fixed ones
    convergence_time: Annotated[float, Ge(0), Le(1e5)] = 10.0  # [s] from float to fixed
    satellites_min: Annotated[int, Ge(4), Le(24)] = 5  # satellites of a fixed solution; only with `constellation`
    age_max: Annotated[float, Ge(0), Le(1e5)] = 60.0  # [s] maximum age of corrections
    corrections_lost: tuple[Gap, ...] | None = None  # [s] times without corrections: { start, stop }


class RtkState(NamedTuple):
    """State of the solution."""

    converged: float = math.inf  # [s] since the carrier phases are used without interruption
    age: float = 0.0  # [s] of the corrections
    fix: int = GPS_RTK  # GPS_SINGLE, GPS_FLOAT or GPS_RTK


def check_rtk(r: Rtk | None) -> None:
    """Raise ConfigError if a gap ends before it starts."""
    for i, gap in enumerate(r.corrections_lost or () if r else ()):
        if not gap.stop > gap.start:
            where = f"rtk.corrections_lost.{i}.stop"
            raise ConfigError(where, f"got {gap.stop:g} s", f"later than start = {gap.start:g} s")


@kernel
def _lost(gaps: tuple[Gap, ...] | None, time: float) -> bool:
    if gaps is None:
        return False
    result = False
    for gap in gaps:
        result = result or gap.start <= time < gap.stop
    return result


@kernel
def update_solution(r: Rtk | None, s: RtkState, interval: float, time: float, used: int, has_fix: bool) -> RtkState:
    """Return the state of the solution at a sample.

    Args:
        r: parameters; None: no such solutions.
        s: state at the last sample.
        interval: [s] since then.
        time: [s] of the simulation.
        used: satellites of the fix; 0 if they are not modelled.
        has_fix: True if there is a fix.
    """
    if r is None:
        return s
    age = s.age + interval if _lost(r.corrections_lost, time) else 0.0
    single = age > r.age_max
    converged = 0.0 if single or not has_fix else s.converged + interval
    few = 0 < used < r.satellites_min
    if few:
        converged = 0.0
    fixed = not few and converged >= r.convergence_time
    return RtkState(converged, age, GPS_SINGLE if single else GPS_RTK if fixed else GPS_FLOAT)


@kernel
def ratio(r: Rtk | None, fix: int) -> float:
    """Return the factor of the correlated errors."""
    if r is None:
        return 1.0
    return r.single_ratio if fix == GPS_SINGLE else r.float_ratio if fix == GPS_FLOAT else 1.0
