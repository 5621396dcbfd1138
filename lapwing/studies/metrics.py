"""The figures of a flight: numbers by name, for a scene's `[success]` and for the rows of campaigns."""

import hashlib
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from lapwing.cosim.scene import Scene
from lapwing.kernels import kernel
from lapwing.services.common.success_criteria import Success
from lapwing.studies.flight_data import FlightData
from lapwing.studies.ground_contacts import touches
from lapwing.studies.saturation import limits, saturation
from lapwing.studies.tracking import AXES, Reference, errors, plain, reach, rmse, roll_pitch_yaw, strided, total

SURE = 3.0  # standard deviations of its own that the estimate is given

FIGURES: dict[str, str] = {
    "verdict": "",  # how it ended: landed, crashed, timed out, ...
    "told": "",  # the same as a sentence
    "time": "s",  # of the last touch-down, of the crash, or of the end
    "duration": "s",
    **{f"rmse.{axis}": unit for axis, unit in AXES.items()},  # of the reference against the truth
    **{f"rmse_estimate.{axis}": unit for axis, unit in AXES.items()},  # of the reference against the estimate
    "max_distance": "m",  # from the reference
    "overshoot": "m",  # beyond the least and greatest of the reference along x, y or z
    "max_tilt": "rad",  # from the vertical
    "saturation": "",  # share of the time in the air with a motor at a limit of its voltage
    "energy": "J",  # electrical
    "touchdown.x": "m",  # at the last touch-down
    "touchdown.y": "m",
    "touchdown.tilt": "rad",
    "touchdown.speed": "m/s",  # downwards, at the hardest touch
    **{f"inside.{axis}": "" for axis in "xyz"},  # share of the time with the truth within 3 sigma of the estimate
}
"""Name and unit of every figure, in the order of the columns of a campaign's table."""


def check_success(scene: Scene) -> None:
    """Every figure that the scene's `[success]` names is one of these. Raises SceneError where one is not."""
    with scene.located():
        scene[Success].check_names(FIGURES)


def figures(flight: FlightData) -> dict[str, Any]:
    """The figures of a flight by name; NaN where it says nothing of one."""
    truth, verdict, armed = flight.truth, flight.verdict, flight.armed
    n, t = len(armed), truth.times
    found: dict[str, Any] = dict.fromkeys(FIGURES, math.nan)
    found |= {"verdict": verdict.kind, "told": str(verdict), "time": verdict.time, "duration": float(t[-1])}
    found |= {"max_tilt": _tilt(truth.tilt_cosine.min()), "energy": flight.energy}
    last = max((touch.start for touch in touches(truth)), default=0)
    if last:
        x, y, _ = map(float, truth.position[last])
        found |= {"touchdown.x": x, "touchdown.y": y, "touchdown.tilt": _tilt(truth.tilt_cosine[last])}
        found |= {"touchdown.speed": verdict.touchdown}
    if n == 0:
        return found
    highest = flight.origin.scene.get("airframe", {}).get("motor", {}).get("max_voltage")
    if highest is not None:
        limits = saturation(truth, armed, highest)
        found["saturation"] = limits.share(limits.lasted)
    if not armed.any():
        return found
    distance, beyond = flight.reach
    found |= {f"rmse.{axis}": value for axis, value in flight.rmse.items()}
    found |= {"max_distance": distance, "overshoot": max(0.0, beyond)}
    return found | _of_estimate(flight, armed)


def compile_ahead() -> None:
    """Compile what figures are made by, which is the same for every flight."""
    rows, armed = np.zeros((2, 4)), np.ones(2, bool)  # of a single row numpy does not say how it lies
    errors(np.zeros((2, 6)), rows, rows, armed)
    rmse(Reference(rows, rows, rows[:, 0]), rows, roll_pitch_yaw(rows), armed)
    reach(rows, rows, armed)
    total(rows)
    limits(rows, armed, 1.0)
    _inside(strided(rows), strided(rows), strided(rows), plain(armed, bool))


def _tilt(cosine: float) -> float:
    """The angle [rad] of this cosine, which rounding may have brought beyond 1."""
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _of_estimate(flight: FlightData, armed: np.ndarray) -> dict[str, float]:
    """What only an estimate at every tick tells."""
    n = len(armed)
    if not flight.has("estimate") or len(flight.estimate) < n:
        return {}
    estimate, truth = flight.estimate, flight.truth
    places = strided(estimate.position[:n]), strided(truth.position[:n]), strided(estimate.position_std[:n])
    return {
        **{f"rmse_estimate.{axis}": value for axis, value in flight.rmse_of(estimate).items()},
        **{f"inside.{a}": share for a, share in zip("xyz", _inside(*places, plain(armed, bool)), strict=True)},
    }


@kernel
def _inside(estimate: Any, position: Any, deviation: Any, armed: Any) -> tuple[float, float, float]:
    """Share of the rows while armed with the position within 3 sigma of the estimate, along x, y, z."""
    rows, x, y, z = 0, 0, 0, 0
    for row in range(len(armed)):
        if armed[row]:
            rows += 1
            x += abs(estimate[row, 0] - position[row, 0]) <= SURE * deviation[row, 0]
            y += abs(estimate[row, 1] - position[row, 1]) <= SURE * deviation[row, 1]
            z += abs(estimate[row, 2] - position[row, 2]) <= SURE * deviation[row, 2]
    return x / rows, y / rows, z / rows


def end_state(flight: FlightData) -> str:
    """Digest of the true state at the last tick: two flights that share it went the same way, to the bit."""
    truth = flight.truth
    numbers = [truth.times[-1:], truth.position[-1], truth.orientation[-1], truth.velocity[-1], truth.rotor_speed[-1]]
    return hashlib.blake2b(np.concatenate(numbers).astype("<f8").tobytes(), digest_size=8).hexdigest()


def joint_end_state(flights: Sequence[FlightData]) -> str:
    """Digest of the end of one flight, as of `end_state`; of several vehicles one digest over those of all."""
    states = [end_state(flight) for flight in flights]
    return states[0] if len(states) == 1 else hashlib.blake2b("".join(states).encode(), digest_size=8).hexdigest()
