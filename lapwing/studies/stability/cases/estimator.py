"""Case 16: the estimator under sensor faults that its model excludes."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.flights.flight_data import FlightData
from lapwing.flights.rotation_arrays import from_xyzw
from lapwing.kernels.cell import read
from lapwing.messages.topics import ESTIMATE, TRUTH
from lapwing.services.autopilot.estimator.blocks.gps_block import GpsFusion
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row

HARD = "a mission with a gyro bias jump, 60 s without GPS, an inverted magnetometer, or all sensors frozen"

START, END = 20.0, 100.0  # [s]
SENSORS = ("imu", "gps", "magnetometer", "barometer", "sonar")
NEVER = '{kind = "dropout", start = 1000.0, stop = 1001.0}'  # lets all flights share their compiled code
TO_THE_END = f"start = {START}, stop = 1000.0}}"
FAULTS: dict[str, dict[str, str]] = {
    "gyro_bias": {"imu": f'{{kind = "bias", channel = "gyro", size = [0.0175, 0.0, 0.0], {TO_THE_END}'},
    "gps_outage": {"gps": f'{{kind = "dropout", start = {START}, stop = {START + 60.0}}}'},
    "magnetometer": {"magnetometer": f'{{kind = "scale", size = [-1.0, -1.0, -1.0], {TO_THE_END}'},
    "frozen": dict.fromkeys(SENSORS, f'{{kind = "freeze", {TO_THE_END}'),
}
SIGMAS = 6.0
INVARIANT = "largest error over its standard deviation, while the health is good"
WHY = "of 3000 estimates of nine states, one beyond six standard deviations is expected in ten thousand flights"


class Outcome(NamedTuple):
    """A flight under a fault."""

    t: np.ndarray  # [s] of the estimates (k,)
    position: np.ndarray  # [m] error (k,)
    angle: np.ndarray  # [rad] error (k,)
    position_std: np.ndarray  # [m] estimated standard deviation (k,)
    angle_std: np.ndarray  # [rad] estimated standard deviation (k,)
    healthy: np.ndarray  # True if the estimate reports good health (k,)
    min_eigenvalue: float  # smallest eigenvalue of the error correlations, checked once per second

    @property
    def ratio(self) -> np.ndarray:
        """The larger of both errors over their standard deviations, (k,)."""
        return np.maximum(self.position / self.position_std, self.angle / self.angle_std)


def fly(faults: dict[str, str], extra: Sequence[str] = (), *, ignore_age: bool = False) -> Outcome:
    """Fly the mission with sensor faults and overrides.

    Args:
        faults: TOML table of the fault by sensor.
        extra: further overrides "KEY=VALUE".
        ignore_age: treat GPS fixes as measured on arrival (baseline).
    """
    overrides = [f"run.duration={END}", *extra, *(f"sensors.{s}.faults=[{faults.get(s, NEVER)}]" for s in SENSORS)]
    config = resolve(load("delivery_mission", overrides))
    services = create_all(config)
    if ignore_age:
        gps = next(block for service in services for block in service.blocks if isinstance(block.parameters, GpsFusion))
        gps.parameters = gps.parameters._replace(age=0)
    topics = (TRUTH, ESTIMATE)
    selected = {encoder.port for service in services for encoder in service.encoders if encoder.topic in topics}
    diagram = BlockDiagram(config, services, 64, selected)
    filtering: Any = next(block for service in services for block in service.blocks if block.name.endswith("inertial"))
    min_eigenvalue = 1.0
    while not diagram.ended and diagram.tick <= config.last_tick:
        diagram.advance(min(diagram.tick + round(1.0 / config.interval), config.last_tick + 1))
        min_eigenvalue = min(min_eigenvalue, smallest_eigenvalue(_covariance(read(filtering.state))))
    flight = FlightData.of(diagram, topics)
    return _outcome(flight, min_eigenvalue)


def _covariance(state: Any) -> np.ndarray:
    return next(part.memory.covariance for part in (state, *state) if hasattr(part, "memory"))


def _outcome(flight: FlightData, min_eigenvalue: float) -> Outcome:
    estimate, truth = flight.estimate, flight.truth
    settled = estimate.times > 5.0  # after the filter has settled
    at = np.searchsorted(truth.times, estimate.times[settled]).clip(max=len(truth.times) - 1)
    attitudes = estimate.orientation[settled], truth.orientation[at]
    trace = np.einsum("ki,ki->k", *(matrices(from_xyzw(q)) for q in attitudes))
    return Outcome(
        estimate.times[settled],
        np.linalg.norm(estimate.position[settled] - truth.position[at], axis=1),
        np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0)),
        np.linalg.norm(estimate.position_std[settled], axis=1),
        np.linalg.norm(estimate.attitude_std[settled], axis=1),
        estimate.health_flags[settled] == 0,
        min_eigenvalue,
    )


def smallest_eigenvalue(covariance: np.ndarray) -> float:
    """Return the smallest eigenvalue of the correlation matrix of a covariance."""
    size = np.sqrt(np.abs(np.diag(covariance)))
    return float(np.linalg.eigvalsh(0.5 * (covariance + covariance.T) / np.outer(size, size)).min())


def textbook_eigenvalue() -> float:
    """Return the smallest eigenvalue under P = (1 - K H) P with precise, correlated measurements (baseline)."""
    P, rng = np.diag([1e6] * 3), np.random.default_rng(1)
    min_eigenvalue = 1.0
    for _ in range(30):
        H = 1.0 + 1e-5 * rng.normal(size=(1, 3))
        K = P @ H.T / (H @ P @ H.T + 1e-6)
        P = (np.eye(3) - K @ H) @ P
        min_eigenvalue = min(min_eigenvalue, smallest_eigenvalue(P))
    return min_eigenvalue


def run() -> CaseResult:
    """Compare errors with the estimated covariance."""
    outcomes = {name: fly(faults) for name, faults in FAULTS.items()}
    rows, curves = [], []
    for name, o in outcomes.items():
        before = np.flatnonzero(o.t < START)[-1]
        claimed_ratio = np.maximum(o.position / o.position_std[before], o.angle / o.angle_std[before])
        baseline = "standard deviation before the fault", float(claimed_ratio[o.t >= START].max())
        if name == "gyro_bias":
            baseline = "integration of the gyro", 0.0175 * (o.t[-1] - START) / o.angle_std[before]
        if name == "magnetometer":
            baseline = "heading of the magnetometer", np.pi / o.angle_std[before]
        rows.append(
            Row(name, "error-state filter with gates and health", INVARIANT, SIGMAS, WHY,
                float(o.ratio[o.healthy].max()), *baseline)
        )  # fmt: skip
        curves.append(Curve(name, o.t, np.maximum(o.ratio, 1e-3)))
    min_eigenvalue = min(o.min_eigenvalue for o in outcomes.values())
    rows.append(
        Row("covariance", "sequential updates of a symmetric covariance",
            "negative part of the smallest eigenvalue of the correlations", 0.0,
            "a covariance has no negative eigenvalue", max(0.0, -min_eigenvalue),
            "P = (1 - K H) P", max(0.0, -textbook_eigenvalue()))
    )  # fmt: skip
    return CaseResult(rows, Plot("time [s]", "error over its standard deviation", curves, SIGMAS))
