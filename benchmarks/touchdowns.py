"""Landings of five airframes in wind, on slopes, with errors of barometer and sonar, by both ways to stop the motors.

    python -m benchmarks.touchdowns [--count N] [--first N] [--airframe NAME] [--listed]

Prints a table of docs/explanation/theory/trajectory_and_control.md and the number of flights that miss a bar: with the
land detector the motors stop less than 20 mm above the place of rest, every flight lands and is at rest within 2 s of
its first touch, and none tips over that stands with `autopilot.landing.cut_height` = 0.05 m, the paper's cut.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from os import cpu_count
from typing import Annotated, Any, NamedTuple

import numpy as np
from typer import Exit, Option

from benchmarks._command import command_line
from lapwing import Flight
from lapwing.dynamics.lie.quaternion import from_roll_pitch_yaw, rotate
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.simulate import fly

AIRFRAMES = {  # gain sets
    "delivery_drone": "tuned",
    "quad_x": "quad_x",
    "hexacopter": "hexacopter",
    "crazyflie_21": "crazyflie_21",
    "racer_250": "racer_250",
}
MOST_WIND, MOST_SLOPE = 8.0, math.tan(math.radians(10.0))  # [m/s], rise over run
PRESSURE_ERROR = 6.0  # [Pa] one standard deviation: 0.5 m
MOST_HEIGHT, MOST_TIME = 0.020, 2.0  # [m], [s]
CUT = {"autopilot.landing.cut_height": 0.05}
MOST_TILT = math.radians(30.0)  # from the ground's normal, of a vehicle on its feet
SPEED_ERROR = 0.1  # [m/s] of the speed in gusts, more than a tenth of a slow descent
DOWN = 8.0  # [s] start of the descent


class Touchdown(NamedTuple):
    """Figures of a landing."""

    stopped: bool  # the motors
    height: float  # [m] at the stop of the motors, above the plane of the ground through the place of rest
    speed: float  # [m/s] downwards at the hardest touch
    commanded: float  # [m/s] downwards, the fastest setpoint in the half second before the first touch
    settled: float  # [s] from the first touch to the last one
    tilt: float  # [rad] at the end, from the ground's normal
    upright: bool


def case(number: int, airframe: str) -> dict[str, Any]:
    """Return the keys of a landing that differ from its scene."""
    rng = np.random.default_rng([7, number])
    speed, slope = rng.uniform(0.1, MOST_WIND), MOST_SLOPE * rng.uniform()
    course, uphill = rng.uniform(0.0, 2.0 * math.pi, 2)
    lost, bias, ahead = DOWN + rng.uniform(-3.0, 3.0), rng.normal(0.0, PRESSURE_ERROR), rng.uniform(0.0, 2.0)
    ramp = {"kind": "ramp", "to": 0.0, "rate": rng.uniform(0.5, 1.5)}
    stop = {"kind": "minimum_jerk", "to": 0.0, "duration": rng.uniform(3.0, 6.0)}
    phases = [
        {"name": "align", "duration": 2.0},
        {"name": "climb", "z": {"kind": "minimum_jerk", "to": 2.5, "duration": 3.0}},
        {"name": "ahead", "x": {"kind": "minimum_jerk", "to": ahead, "duration": DOWN - 5.0}},
        {"name": "descend", "z": ramp if rng.uniform() < 0.5 else stop},
        {"name": "land", "duration": 3.0},
    ]
    keys = {
        "run.seed": number + 1,
        "run.duration": 40.0,
        "vehicle.airframe": airframe,
        "communication.rate": 500,
        "autopilot.gains": AIRFRAMES[airframe],
        "environment.terrain.slope": [slope * math.cos(uphill), slope * math.sin(uphill)],
        "effects.wind_constant.velocity": [speed * math.cos(course), speed * math.sin(course), 0.0],
        "effects.wind_dryden.wind_speed": speed,
        "sensors.barometer.faults": [{"kind": "bias", "size": bias, "start": DOWN - 2.0}],
        "sensors.sonar.faults": [{"kind": "dropout", "start": lost, "stop": lost + rng.uniform(0.5, 6.0)}],
        "trajectory.phase": phases,
    }
    if airframe != "crazyflie_21":
        return keys
    own = {  # on the true state, as its scene, which has other effects, and a centre of mass below the feet
        "effects.body_drag.area": [0.003, 0.003, 0.008],
        "airframe.mass.centre": [0.0, 0.0, 0.0],
    }
    return own | {name: value for name, value in keys.items() if not name.startswith("sensors.")}


def land(keys: dict[str, Any]) -> Touchdown:
    """Fly a landing."""
    scene = "crazyflie_21" if keys["vehicle.airframe"] == "crazyflie_21" else "quad_x"
    flight = fly(resolve(load(scene, keys)), kind=Flight)
    truth, armed = flight.truth, flight.armed
    t, contact = truth.times, truth.ground_contact
    a, b = keys["environment.terrain.slope"]
    normal = np.array([-a, -b, 1.0]) / math.sqrt(1.0 + a * a + b * b)
    above = (truth.position - truth.position[-1]) @ normal
    touches = np.flatnonzero(contact[1:] & ~contact[:-1] & (t[1:] > DOWN)) + 1
    stops = np.flatnonzero(armed[:-1] & ~armed[1:]) + 1
    up = rotate(from_roll_pitch_yaw(*truth.attitude[-1]), (0.0, 0.0, 1.0))
    tilt = math.acos(min(1.0, float(np.dot(up, normal))))
    if not len(touches) or not len(stops):
        return Touchdown(False, math.nan, math.nan, math.nan, math.inf, tilt, tilt < MOST_TILT)
    first = touches[0]
    n = len(flight.setpoint)
    near = flight.setpoint.velocity[max(0, first - 250) : min(n, first + 1), 2]
    speed = -min(float(truth.velocity[k - 1, 2]) for k in touches)
    return Touchdown(
        True, float(above[stops[-1]]), speed, -float(near.min()), float(t[touches[-1]] - t[first]), tilt,
        tilt < MOST_TILT,
    )  # fmt: skip


def main(
    count: Annotated[int, Option(help="number of landings, shared by the airframes in turn")] = 200,
    first: Annotated[int, Option(help="number of the first landing")] = 0,
    airframe: Annotated[str | None, Option(help="fly only this airframe's landings")] = None,
    listed: Annotated[bool, Option(help="list every landing")] = False,
) -> None:
    names = list(AIRFRAMES)
    numbers = [k for k in range(first, first + count) if airframe in (None, names[k % len(names)])]
    cases = [case(k, names[k % len(names)]) for k in numbers]
    flights = {}
    for way, more in (("detector", {}), ("cut", CUT)):
        with ThreadPoolExecutor(cpu_count()) as pool:
            flights[way] = list(pool.map(land, [keys | more for keys in cases]))
    if listed:
        for k, *pair in zip(numbers, *flights.values(), strict=True):
            print(k, names[k % len(names)], *pair, sep="\n    ")
    columns = (
        f"{'landings':>8} {'stop, mm':>9} {'touch, m/s':>11} {'over command':>12} {'settled, s':>10} {'tipped':>6}"
    )
    print(f"{'':24} {columns}")
    for name in names:
        for way, results in flights.items():
            rows = [r for k, r in zip(numbers, results, strict=True) if names[k % len(names)] == name]
            if rows:
                print(f"{name:14} {_row(way, rows)}")
    new, old = flights.values()
    late = sum(not r.stopped or r.settled > MOST_TIME for r in new)
    high = sum(r.stopped and abs(r.height) > MOST_HEIGHT for r in new)
    fast = sum(r.stopped and r.speed > max(1.1 * r.commanded, r.commanded + SPEED_ERROR) for r in new)
    tipped = sum(before.upright and not after.upright for before, after in zip(old, new, strict=True))
    print(f"motors stop above {1e3 * MOST_HEIGHT:g} mm: {high}; not at rest within {MOST_TIME:g} s: {late}; "
          f"tipped over, but not with the cut: {tipped}; faster than commanded: {fast}")  # fmt: skip
    raise Exit(1 if high or late or tipped else 0)


def _row(way: str, rows: list[Touchdown]) -> str:
    """Return the largest figures of landings that stopped."""
    landed = [r for r in rows if r.stopped]
    height, speed = max(abs(r.height) for r in landed), max(r.speed for r in landed)
    over = max(r.speed - r.commanded for r in landed)
    settled, tipped = max(r.settled for r in landed), sum(not r.upright for r in rows)
    return f"{way:9} {len(landed):8} {1e3 * height:9.1f} {speed:11.2f} {over:12.2f} {settled:10.2f} {tipped:6}"


if __name__ == "__main__":
    command_line(main)
