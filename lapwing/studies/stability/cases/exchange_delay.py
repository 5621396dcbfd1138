"""Case 14: the closed loop over exchange intervals and delays."""

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.tick_schedule import InputPort
from lapwing.cosim.scene import Scene
from lapwing.messages.topics import TRUTH
from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.margins import open_loops, stable
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.common.communication_schema import Communication
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.flight_data import FlightData
from lapwing.studies.simulate import fly
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row

HARD = "exchange intervals of 1 to 50 ms, commands late by 0 to 5 exchanges: where the closed loop loses its stability"

RATES = (1000, 500, 250, 200, 160, 125, 100, 80, 64, 50, 40, 32, 25, 20)  # [Hz]
DELAYS = (0, 1, 2, 3, 4, 5)  # exchanges between a measurement and what is done about it
PUSH = (
    "trajectory.phase.1.duration=10.0",
    'trajectory.phase.1.x={kind="minimum_jerk", to=0.05, duration=1.0}',
    'trajectory.phase.1.yaw={kind="minimum_jerk", to=0.05, duration=1.0}',
)  # small, so that no motor saturates
QUIET = 0.02  # [rad/s] a turn rate that is left of a push six seconds ago
APART = 1.3
WHY = "a step of the grid of intervals, of 1.25 to 1.28 where it matters: the loop is sampled, the analysis continuous"


def scene(rate: int) -> Scene:
    """Return the hover with a push, at a communication rate."""
    slow = [f"rates.{name}=1" for name in ("pose", "estimate", "status", "battery", "body_states", "commands")]
    return load("hover", [f"communication.rate={rate}", f"solver.step={1.0 / rate / -(-1000 // rate)!r}", *slow, *PUSH])


def late(config: RunConfig, delay: int) -> RunConfig:
    """Return the run configuration with a command delay of so many ticks."""
    plant = config.services["plant"]
    inputs = tuple(InputPort(i.port, 1 + delay) for i in plant.inputs)  # 1: from the next tick on is at once
    return config._replace(services={**config.services, "plant": plant._replace(inputs=inputs)})


def flies(rate: int, delay: int) -> bool:
    """Return True if the push has died away in flight."""
    flight: FlightData = fly(late(resolve(scene(rate)), delay), (TRUTH,))
    t, turning = flight.truth.times, np.linalg.norm(flight.truth.angular_velocity, axis=1)
    left = turning[(t > 10.0) & (t < 13.0)]  # nothing of a flight that has crashed
    return not flight.failure and len(left) > 0 and bool(left.max() < QUIET)


def is_stable_by_nyquist(rate: int, delay: int) -> bool:
    """Return True if Nyquist's criterion calls every loop stable."""
    of = scene(rate)
    frame = known_airframe(of)
    result = open_loops(build(of[GainSet].plain(), frame), frame, of[Communication].interval, delay)
    return all(stable(loop) for loop in result.values())


def longest(works: list[bool]) -> float:
    """Return the longest interval [s] up to which all intervals are stable."""
    broken = next((i for i, good in enumerate(works) if not good), len(works))
    return 1.0 / RATES[max(broken - 1, 0)]


def run() -> CaseResult:
    """Compare the longest interval of each delay, in flight and by analysis."""
    measured = np.array([longest([flies(rate, d) for rate in RATES]) for d in DELAYS])
    linear = np.array([longest([is_stable_by_nyquist(rate, d) for rate in RATES]) for d in DELAYS])
    baseline = np.full(len(DELAYS), 1.0 / RATES[-1])
    ratio = np.maximum(measured / linear, linear / measured)
    blind = np.maximum(measured / baseline, baseline / measured)
    row = Row(
        "interval",
        "Nyquist with the delay and half a tick of hold",
        "longest stable interval in flight over that of the analysis, or the inverse, worst of 6 delays",
        APART,
        WHY,
        float(ratio.max()),
        "the loop as if it were continuous: any interval is stable",
        float(blind.max()),
    )
    x = np.array(DELAYS, dtype=float)
    curves = [
        Curve("in flight", x, 1e3 * measured),
        Curve("by analysis", x, 1e3 * linear),
        Curve("no delay", x, 1e3 * baseline),
    ]
    return CaseResult([row], Plot("delay [exchanges]", "longest stable interval [ms]", curves))
