"""Case 14: stability of the closed loop over communication steps and delays."""

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.tick_schedule import InputPort
from lapwing.cosim.scene import Scene
from lapwing.flights.flight_data import FlightData
from lapwing.messages.topics import TRUTH
from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.margins import open_loops, stable
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.simulate import fly
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row

HARD = "communication steps of 1 to 50 ms, commands delayed by 0 to 5 steps: the closed loop becomes unstable"

RATES = (1000, 500, 250, 200, 160, 125, 100, 80, 64, 50, 40, 32, 25, 20)  # [Hz]
DELAYS = (0, 1, 2, 3, 4, 5)  # [ticks] between a measurement and its command
PUSH = (
    "trajectory.phase.1.duration=10.0",
    'trajectory.phase.1.x={kind="minimum_jerk", to=0.05, duration=1.0}',
    'trajectory.phase.1.yaw={kind="minimum_jerk", to=0.05, duration=1.0}',
)  # small, so that no motor saturates
DAMPED = 0.02  # [rad/s] angular velocity six seconds after the push
FACTOR = 1.3
WHY = "ratio of neighbouring intervals, 1.25 to 1.28 near the limits: the loop is sampled, the analysis continuous"


def scene(rate: int) -> Scene:
    """Return the scene `hover` with a small step of the reference, at a communication rate [Hz]."""
    slow = [f"rates.{name}=1" for name in ("pose", "estimate", "status", "battery", "body_states", "commands")]
    return load("hover", [f"communication.rate={rate}", f"solver.step={1.0 / rate / -(-1000 // rate)!r}", *slow, *PUSH])


def with_delay(config: RunConfig, delay: int) -> RunConfig:
    """Return the run configuration with a command delay [ticks]."""
    plant = config.services["plant"]
    inputs = tuple(InputPort(i.port, 1 + delay) for i in plant.inputs)  # 1: no delay, used from the next tick on
    return config._replace(services={**config.services, "plant": plant._replace(inputs=inputs)})


def is_damped_in_flight(rate: int, delay: int) -> bool:
    """Return True if the push is damped in flight."""
    flight: FlightData = fly(with_delay(resolve(scene(rate)), delay), (TRUTH,))
    t, turning = flight.truth.times, np.linalg.norm(flight.truth.angular_velocity, axis=1)
    rest = turning[(t > 10.0) & (t < 13.0)]  # empty if the flight has crashed
    return not flight.failure and len(rest) > 0 and bool(rest.max() < DAMPED)


def is_stable_by_nyquist(rate: int, delay: int) -> bool:
    """Return True if every loop is stable by Nyquist's criterion."""
    config = scene(rate)
    frame = known_airframe(config)
    result = open_loops(build(config[GainSet].plain(), frame), frame, config[Communication].interval, delay)
    return all(stable(loop) for loop in result.values())


def longest(stability: list[bool]) -> float:
    """Return the longest interval [s] up to which all of `RATES` are stable."""
    first_unstable = next((i for i, is_stable in enumerate(stability) if not is_stable), len(stability))
    return 1.0 / RATES[max(first_unstable - 1, 0)]


def run() -> CaseResult:
    """Compare the longest stable interval of each delay in flight with that of the analysis."""
    measured = np.array([longest([is_damped_in_flight(rate, d) for rate in RATES]) for d in DELAYS])
    linear = np.array([longest([is_stable_by_nyquist(rate, d) for rate in RATES]) for d in DELAYS])
    baseline = np.full(len(DELAYS), 1.0 / RATES[-1])
    ratio = np.maximum(measured / linear, linear / measured)
    baseline_ratio = np.maximum(measured / baseline, baseline / measured)
    row = Row(
        "interval", "Nyquist with the delay and half a tick of hold",
        "ratio of the longest stable intervals in flight and by analysis, worst of 6 delays", FACTOR, WHY,
        float(ratio.max()), "a continuous loop: every interval is stable", float(baseline_ratio.max()),
    )  # fmt: skip
    x = np.array(DELAYS, dtype=float)
    curves = [
        Curve("in flight", x, 1e3 * measured),
        Curve("by analysis", x, 1e3 * linear),
        Curve("no delay", x, 1e3 * baseline),
    ]
    return CaseResult([row], Plot("delay [ticks]", "longest stable interval [ms]", curves))
