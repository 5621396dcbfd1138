"""Case 22: scenes drawn at random: all that validate fly, and fly alike twice."""

import numpy as np

from lapwing.services.scene_resolver import load
from lapwing.studies.flight_data import FlightData
from lapwing.studies.simulate import fly
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.flights import finite

HARD = "missions whose vehicle, ground, wind, sensors and exchange are drawn at random over decades"

COUNT = 50
WHY = "none: what validates flies"


def drawn(seed: int) -> list[str]:
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
    slow = {f"rates.{name}": 10 for name in ("pose", "estimate", "status", "battery", "body_states", "commands")}
    return [f"{key}={value}" for key, value in {**result, **slow}.items()]


def flights(seed: int) -> tuple[FlightData, FlightData] | None:
    """Fly a scene twice. Return None if it is invalid."""
    try:
        first: FlightData = fly(load("delivery_mission", drawn(seed)))
    except ValueError:  # also: too heavy for its rotors
        return None
    second: FlightData = fly(load("delivery_mission", drawn(seed)))
    return first, second


def run() -> CaseResult:
    """Count flights that diverge, and those that differ when repeated."""
    pairs = [pair for seed in range(COUNT) if (pair := flights(seed))]
    broken = [bool(first.failure) or not finite(first) for first, _ in pairs]
    unlike = [first.digest != second.digest for first, second in pairs]
    generator = np.random.default_rng(1)  # the baseline way: one generator with a state for all that is random
    again = [generator.normal(size=3).tobytes() != generator.normal(size=3).tobytes() for _ in pairs]
    unsplit = [1.0 / float(lag) * float(step) > 2.0 for lag, step in map(_lag_and_step, range(COUNT))]
    rows = [
        Row(
            "sound",
            "checks; steps are split where lag or ground ask for it",
            f"of {len(pairs)} scenes that validate, ending in no number within 1 s",
            0.0,
            WHY,
            float(sum(broken)),
            "forward Euler on the motors' lag, as the step is",
            float(sum(unsplit)),
        ),
        Row(
            "digest",
            "randomness by counter",
            f"of {len(pairs)} scenes, unlike when flown again",
            0.0,
            "none: same scene and seed, same bits",
            float(sum(unlike)),
            "one generator with a state",
            float(sum(again)),
        ),
    ]
    highest = [float(np.abs(first.truth.angular_velocity).max()) for first, _ in pairs]
    x = np.arange(len(pairs), dtype=float)
    return CaseResult(
        rows, Plot("scene", "highest turn rate [rad/s]", [Curve("in flight", x, np.array(highest) + 1e-12)])
    )


def _lag_and_step(seed: int) -> tuple[str, str]:
    result = dict(item.split("=", 1) for item in drawn(seed))
    return result["airframe.motor.time_constant"], result["solver.step"]
