"""Metrics of a flight by name, for a scene's `[success]` and for the rows of campaigns."""

import hashlib
import math
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from lapwing.cosim.scene import Scene
from lapwing.flights.consistency import SOURCES, consistency
from lapwing.flights.flight_data import FlightData
from lapwing.flights.saturation import highest_voltage, limits, saturation
from lapwing.flights.tracking import AXES, Reference, errors, plain, reach, rmse, roll_pitch_yaw, strided_view, total
from lapwing.kernels import kernel
from lapwing.services.common.schemas.success_criteria import Success

SIGMAS = 3.0  # standard deviations of the estimate

METRICS: dict[str, str] = {
    "outcome": "",  # landed, completed, landed elsewhere, ended in failsafe, timed out, aborted, crashed, diverged
    "outcome_text": "",  # outcome with the circumstances
    "time": "s",  # time of the last touch-down, of the crash, or of the end
    "duration": "s",
    "target_distance": "m",  # horizontal distance from the mission's target at the end
    "failsafe_time": "s",  # start of the failsafe in which the flight ended
    **{f"rmse.{axis}": unit for axis, unit in AXES.items()},  # error of the truth from the reference
    **{f"rmse_estimate.{axis}": unit for axis, unit in AXES.items()},  # error of the estimate from the reference
    "max_distance": "m",  # largest distance from the reference
    "overshoot": "m",  # beyond the extremes of the reference along x, y or z
    "max_tilt": "rad",  # largest angle from the vertical
    "saturation": "",  # share of the time in the air with a motor at a limit of its voltage
    "energy": "J",  # electrical energy
    "touchdown.x": "m",  # position and tilt at the last touch-down
    "touchdown.y": "m",
    "touchdown.tilt": "rad",
    "touchdown.speed": "m/s",  # downwards, at the hardest touch
    # share of the time with the truth within 3 sigma of the estimate
    **{f"within_3sigma.{axis}": "" for axis in "xyz"},
    "nees": "",  # mean over time of the joint normalised error squared of attitude, velocity, position; 9 if consistent
    "within_95.nees": "",  # share of the time with this error below its 95 % quantile
    **{f"nis.{source}": "" for source in SOURCES},  # mean normalised innovation squared per dimension; 1 if consistent
    "nis_samples": "",  # number of samples of each of these means
}
"""Name and unit of every metric, in the order of the columns of a campaign's table."""


def check_success(scene: Scene) -> None:
    """Raise SceneError if the scene's `[success]` names an unknown metric."""
    with scene.located():
        scene[Success].check_names(METRICS)


def own_criteria(flight: FlightData) -> dict[str, bool]:
    """Return whether each expression of `success.require` holds, except the default one."""
    with suppress(ValueError):  # the log has no run configuration, or one of another version
        criteria = Success.model_validate(flight.origin.scene.get(Success.TABLE, {}))
        own = [text for text in criteria.require if text not in Success().require]
        unmet = Success(require=tuple(own)).unmet(metrics(flight)) if own else []
        return {text: text not in unmet for text in own}
    return {}


def metrics(flight: FlightData) -> dict[str, Any]:
    """Return the metrics of a flight by name; NaN for those that cannot be computed."""
    truth, outcome, armed = flight.truth, flight.outcome, flight.armed
    n, t = len(armed), truth.times
    result: dict[str, Any] = dict.fromkeys(METRICS, math.nan)
    result |= {"outcome": outcome.kind, "outcome_text": str(outcome), "time": outcome.time, "duration": float(t[-1])}
    for name in ("target_distance", "failsafe_time"):
        value = getattr(outcome, name)
        result[name] = math.nan if value is None else value
    result |= {"max_tilt": _tilt(truth.tilt_cosine.min()), "energy": flight.energy}
    last = max((touch.start for touch in flight.contacts if touch.lands), default=0)
    if last:
        x, y, _ = map(float, truth.position[last])
        result |= {"touchdown.x": x, "touchdown.y": y, "touchdown.tilt": _tilt(truth.tilt_cosine[last])}
        result |= {"touchdown.speed": outcome.touchdown}
    if n == 0:
        return result
    highest = highest_voltage(flight.origin.scene)
    if highest is not None:
        limits = saturation(truth, armed, highest)
        result["saturation"] = limits.share(limits.lasted)
    if not armed.any():
        return result
    distance, beyond = flight.reach
    result |= {f"rmse.{axis}": value for axis, value in flight.rmse.items()}
    result |= {"max_distance": distance, "overshoot": max(0.0, beyond)}
    return result | _of_estimate(flight, armed) | consistency(flight)


def compile_ahead() -> None:
    """Compile the functions that compute metrics, which are the same for every flight."""
    rows, armed = np.zeros((2, 4)), np.ones(2, bool)  # two rows: numpy does not define the layout of one
    errors(np.zeros((2, 6)), rows, rows, armed)
    rmse(Reference(rows, rows, rows[:, 0]), rows, roll_pitch_yaw(rows), armed)
    reach(rows, rows, armed)
    total(rows)
    limits(rows, armed, 1.0)
    _within_3sigma(strided_view(rows), strided_view(rows), strided_view(rows), plain(armed, bool))


def _tilt(cosine: float) -> float:
    """Return the angle [rad] of a cosine that may exceed 1 by rounding."""
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _of_estimate(flight: FlightData, armed: np.ndarray) -> dict[str, float]:
    """Return the metrics that need an estimate at every tick, or {} without one."""
    n = len(armed)
    if not flight.has("estimate") or len(flight.estimate) < n:
        return {}
    estimate, truth = flight.estimate, flight.truth
    columns = estimate.position, truth.position, estimate.position_std
    position, true_position, deviation = (strided_view(column[:n]) for column in columns)
    shares = _within_3sigma(position, true_position, deviation, plain(armed, bool))
    return {
        **{f"rmse_estimate.{axis}": value for axis, value in flight.rmse_of(estimate).items()},
        **{f"within_3sigma.{axis}": share for axis, share in zip("xyz", shares, strict=True)},
    }


@kernel
def _within_3sigma(estimate: Any, position: Any, deviation: Any, armed: Any) -> tuple[float, float, float]:
    """Return the share of the armed rows with the position within 3 sigma of the estimate, along x, y, z."""
    rows, x, y, z = 0, 0, 0, 0
    for row in range(len(armed)):
        if armed[row]:
            rows += 1
            x += abs(estimate[row, 0] - position[row, 0]) <= SIGMAS * deviation[row, 0]
            y += abs(estimate[row, 1] - position[row, 1]) <= SIGMAS * deviation[row, 1]
            z += abs(estimate[row, 2] - position[row, 2]) <= SIGMAS * deviation[row, 2]
    return x / rows, y / rows, z / rows


def end_state(flight: FlightData) -> str:
    """Return the digest of the true state at the last tick; equal for flights that are bit-for-bit identical."""
    truth = flight.truth
    numbers = [truth.times[-1:], truth.position[-1], truth.orientation[-1], truth.velocity[-1], truth.rotor_speed[-1]]
    return hashlib.blake2b(np.concatenate(numbers).astype("<f8").tobytes(), digest_size=8).hexdigest()


def joint_end_state(flights: Sequence[FlightData]) -> str:
    """Return the `end_state` of one flight, or one digest over those of several vehicles."""
    states = [end_state(flight) for flight in flights]
    return states[0] if len(states) == 1 else hashlib.blake2b("".join(states).encode(), digest_size=8).hexdigest()
