"""Case 16: the estimator under faults that it was not built for."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.kernels.cell import read
from lapwing.messages.topics import ESTIMATE, TRUTH
from lapwing.services.autopilot.estimator.blocks.gps_block import GpsFusion
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.flight_data import FlightData
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row

HARD = "the mission with a gyro bias jump, 60 s without GPS, a magnetometer upside down, all sensors frozen"

START, END = 20.0, 100.0  # [s]
SENSORS = ("imu", "gps", "magnetometer", "barometer", "sonar")
NEVER = '{kind = "dropout", start = 1000.0, stop = 1001.0}'  # so that all flights share their machine code
TO_THE_END = f"start = {START}, stop = 1000.0}}"
FAULTS: dict[str, dict[str, str]] = {
    "gyro_bias": {"imu": f'{{kind = "bias", channel = "gyro", size = [0.0175, 0.0, 0.0], {TO_THE_END}'},
    "gps_outage": {"gps": f'{{kind = "dropout", start = {START}, stop = {START + 60.0}}}'},
    "magnetometer": {"magnetometer": f'{{kind = "scale", size = [-1.0, -1.0, -1.0], {TO_THE_END}'},
    "frozen": dict.fromkeys(SENSORS, f'{{kind = "freeze", {TO_THE_END}'),
}
SIGMAS = 6.0
WHY = "of 3000 estimates of nine numbers one beyond six standard deviations is expected in ten thousand flights"


class Outcome(NamedTuple):
    """A flight under a fault."""

    t: np.ndarray  # [s] of the estimates (k,)
    position: np.ndarray  # [m] error (k,)
    angle: np.ndarray  # [rad] error (k,)
    position_std: np.ndarray  # [m] claimed (k,)
    angle_std: np.ndarray  # [rad] claimed (k,)
    well: np.ndarray  # it says that it is well (k,)
    least: float  # eigenvalue of the correlations of the error, at every second

    @property
    def ratio(self) -> np.ndarray:
        """The larger error over what is claimed, (k,)."""
        return np.maximum(self.position / self.position_std, self.angle / self.angle_std)


def fly(faults: dict[str, str], more: Sequence[str] = (), *, as_if_on_time: bool = False) -> Outcome:
    """Fly the mission with faults and overrides; `as_if_on_time`: fixes count as measured on arrival."""
    overrides = [f"run.duration={END}", *more, *(f"sensors.{s}.faults=[{faults.get(s, NEVER)}]" for s in SENSORS)]
    setup = resolve(load("delivery_mission", overrides))
    services = create_all(setup)
    if as_if_on_time:
        gps = next(part for service in services for part in service.parts if isinstance(part.parameters, GpsFusion))
        gps.parameters = gps.parameters._replace(age=0)
    topics = (TRUTH, ESTIMATE)
    selected = {wire.port for service in services for wire in service.wires if wire.topic in topics}
    graph = BlockDiagram(setup, services, 64, selected)
    filtering: Any = next(part for service in services for part in service.parts if part.name.endswith("inertial"))
    least = 1.0
    while not graph.ended and graph.tick <= setup.last_tick:
        graph.advance(min(graph.tick + round(1.0 / setup.interval), setup.last_tick + 1))
        least = min(least, definite(_covariance(read(filtering.state))))
    flight = FlightData.of(graph, topics)
    return _outcome(flight, least)


def _covariance(state: Any) -> np.ndarray:
    return next(part.memory.covariance for part in (state, *state) if hasattr(part, "memory"))


def _outcome(flight: FlightData, least: float) -> Outcome:
    estimate, truth = flight.estimate, flight.truth
    late = estimate.times > 5.0  # it has had time to begin
    at = np.searchsorted(truth.times, estimate.times[late]).clip(max=len(truth.times) - 1)
    turned = np.einsum("ki,ki->k", *(_matrices(q) for q in (estimate.orientation[late], truth.orientation[at])))
    return Outcome(
        estimate.times[late],
        np.linalg.norm(estimate.position[late] - truth.position[at], axis=1),
        np.arccos(np.clip(0.5 * (turned - 1.0), -1.0, 1.0)),
        np.linalg.norm(estimate.position_std[late], axis=1),
        np.linalg.norm(estimate.attitude_std[late], axis=1),
        estimate.health_flags[late] == 0,
        least,
    )


def _matrices(xyzw: np.ndarray) -> np.ndarray:
    return matrices(np.roll(xyzw, 1, axis=1))


def definite(covariance: np.ndarray) -> float:
    """Return the least eigenvalue of the correlations."""
    size = np.sqrt(np.abs(np.diag(covariance)))
    return float(np.linalg.eigvalsh(0.5 * (covariance + covariance.T) / np.outer(size, size)).min())


def textbook() -> float:
    """Return the minimum eigenvalue after the update P = (1 - K H) P with precise, correlated readings (baseline)."""
    P, rng = np.diag([1e6] * 3), np.random.default_rng(1)
    least = 1.0
    for _ in range(30):
        H = 1.0 + 1e-5 * rng.normal(size=(1, 3))
        K = P @ H.T / (H @ P @ H.T + 1e-6)
        P = (np.eye(3) - K @ H) @ P
        least = min(least, definite(P))
    return least


def run() -> CaseResult:
    """Compare errors with the estimated covariance."""
    outcomes = {name: fly(faults) for name, faults in FAULTS.items()}
    rows, curves = [], []
    for name, o in outcomes.items():
        before = np.flatnonzero(o.t < START)[-1]
        trusting = np.maximum(o.position / o.position_std[before], o.angle / o.angle_std[before])
        baseline, label = "its last word before the fault", float(trusting[o.t >= START].max())
        if name == "gyro_bias":
            baseline, label = "the gyro integrated", 0.0175 * (o.t[-1] - START) / o.angle_std[before]
        if name == "magnetometer":
            baseline, label = "the compass taken at its word", np.pi / o.angle_std[before]
        what = "largest error over the claimed deviation, while it says that it is well"
        rows.append(
            Row(
                name,
                "error-state filter with gates and health",
                what,
                SIGMAS,
                WHY,
                float(o.ratio[o.well].max()),
                baseline,
                label,
            )
        )
        curves.append(Curve(name, o.t, np.maximum(o.ratio, 1e-3)))
    least = min(o.least for o in outcomes.values())
    why = "none: a covariance has no negative eigenvalue"
    method = "sequential updates of a symmetric covariance"
    what = "how far the least eigenvalue of the correlations is below zero"
    rows.append(Row("covariance", method, what, 0.0, why, max(0.0, -least), "P = (1 - K H) P", max(0.0, -textbook())))
    return CaseResult(rows, Plot("time [s]", "error over the claimed deviation", curves, SIGMAS))
