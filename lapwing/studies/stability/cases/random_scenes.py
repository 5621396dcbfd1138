"""Case 22: random scenes: valid scenes fly, and repeated flights are bit-for-bit identical."""

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.services.scene_resolver import load
from lapwing.studies.simulate import fly
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.flights import finite

HARD = "missions with random vehicle, ground, wind, sensors and communication step, over decades"

COUNT = 50
WHY = "none: a valid scene flies"


def random_overrides(seed: int) -> list[str]:
    """Return random overrides of the delivery mission."""
    rng = np.random.default_rng(seed)

    def decades(low: float, high: float) -> float:
        return float(10.0 ** rng.uniform(np.log10(low), np.log10(high)))

    mass, size, rate = decades(2.5, 25.0), decades(0.2, 1.5), int(rng.choice([50, 100, 200, 250, 500]))
    result = {
        "run.seed": seed,
        "run.duration": 1.0,
        "communication.rate": rate,
        "trajectory.phase.0.duration": 0.2,
        "sensors.imu.rate": rate,
        "communication.coupling": str(rng.choice(["gauss_seidel", "jacobi"])),
        "solver.step": 1.0 / rate / rng.integers(1, 9) / max(1, 250 // rate),
        "airframe.mass.total": mass,
        "airframe.mass.inertia": [float(size * i) for i in (0.27, 0.26, 0.42)],
        "airframe.motor.time_constant": decades(1e-5, 0.2),
        "airframe.rotors.inertia": decades(1e-7, 1e-1),
        "effects.ground_contact.stiffness": decades(1e3, 1e9),
        "effects.ground_contact.damping": decades(1.0, 1e6),
        "effects.ground_contact.friction_dynamic": 0.1,
        "effects.random_wind_force.mean": [float(v) for v in rng.normal(0.0, 15.0, 3)],
        "effects.random_wind_force.sigma": decades(0.01, 10.0),
    }
    slow_rates = {f"rates.{name}": 10 for name in ("pose", "estimate", "status", "battery", "body_states", "commands")}
    return [f"{key}={value}" for key, value in {**result, **slow_rates}.items()]


def flights(seed: int) -> tuple[FlightData, FlightData] | None:
    """Return two flights of the same random scene; None if it is invalid."""
    try:
        first: FlightData = fly(load("delivery_mission", random_overrides(seed)))
    except ValueError:  # invalid, or too heavy for its rotors
        return None
    second: FlightData = fly(load("delivery_mission", random_overrides(seed)))
    return first, second


def run() -> CaseResult:
    """Count flights that diverge, and those that differ when repeated."""
    pairs = [pair for seed in range(COUNT) if (pair := flights(seed))]
    diverged = [bool(first.failure) or not finite(first) for first, _ in pairs]
    different = [first.digest != second.digest for first, second in pairs]
    generator = np.random.default_rng(1)  # baseline: one generator with a state for all random numbers
    baseline_different = [generator.normal(size=3).tobytes() != generator.normal(size=3).tobytes() for _ in pairs]
    unsplit = [1.0 / float(lag) * float(step) > 2.0 for lag, step in map(_lag_and_step, range(COUNT))]
    rows = [
        Row("finite", "validation; steps split for motor lag and ground",
            f"valid scenes with a non-finite state within 1 s, of {len(pairs)}", 0.0, WHY, float(sum(diverged)),
            "forward Euler on the motor lag, without substeps", float(sum(unsplit))),
        Row("digest", "counter-based random numbers", f"scenes that differ when repeated, of {len(pairs)}", 0.0,
            "none: equal scene and seed give identical bits", float(sum(different)), "a single generator with a state",
            float(sum(baseline_different))),
    ]  # fmt: skip
    turn_rate = [float(np.abs(first.truth.angular_velocity).max()) for first, _ in pairs]
    x = np.arange(len(pairs), dtype=float)
    return CaseResult(
        rows, Plot("scene", "largest angular velocity [rad/s]", [Curve("in flight", x, np.array(turn_rate) + 1e-12)])
    )


def _lag_and_step(seed: int) -> tuple[str, str]:
    result = dict(item.split("=", 1) for item in random_overrides(seed))
    return result["airframe.motor.time_constant"], result["solver.step"]
