"""Case 12: saturated motors."""

import numpy as np

from lapwing.kernels import python_function
from lapwing.messages.topics import ACTUATORS, ESTIMATE, SETPOINT, STATUS, TRUTH
from lapwing.services.autopilot import pid
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.motor import thrust_at
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.scene_resolver import load
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.flights import fly

HARD = (
    "a gust of 25 m/s, half a second without thrust, a payload dropped in wind, a motor out: outputs that are cut off"
)

STEP, AT, LOSS = 0.004, 5.0, 0.5  # [s]
TOPICS = (TRUTH, SETPOINT, ACTUATORS, ESTIMATE, STATUS)
DROP = (
    "effects.payload_release.release_time=15.0",
    "effects.random_wind_force.mean=[25.0,0.0,0.0]",
    "effects.random_wind_force.sigma=2.0",
)
OUT = ("effects.rotor_damage.rotor=1", "effects.rotor_damage.time=5.0")
GUST = (
    "effects.wind_gust.peak=[0.0,0.0,-25.0]",
    "effects.wind_gust.start=10.0",
    "effects.wind_gust.duration=3.0",
    "effects.body_drag.area=[0.06,0.06,0.3]",
    'trajectory.phase.0.z={kind="minimum_jerk", to=10.0, duration=5.0}',
    "trajectory.phase.1.duration=20.0",
    "run.duration=24.0",
)  # from above, on a box so large that all motors are at their limit
OVERSHOOT, BACK, AWAY, UNIT = 1.0, 0.1, 0.5, 1e-12


def height(unwound: bool, loss: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (times, height [m] over the setpoint) of the drone's height loop, without thrust for `loss` [s]."""
    of = load("hover", [])
    frame, gains = known_airframe(of), pid.Pid(*of[GainSet].altitude)
    most = thrust_at(frame.motor, frame.voltage_max)
    weight = 0.25 * frame.mass * frame.gravity
    integrate, output = python_function(pid.integrate), python_function(pid.output)
    z = v = integral = cut = 0.0
    thrust, result = weight, []
    times = np.arange(0.0, 30.0, STEP)
    for t in times:
        integral = integrate(gains, integral, -z, cut if unwound else 0.0, STEP)
        demand = weight + output(gains, integral, -z, -v)
        actual = min(max(demand, 0.0), most)
        cut = float(np.sign(demand - actual))
        if AT <= t < AT + loss:
            actual = 0.0
        thrust += STEP / frame.motor.time_constant * (actual - thrust)
        v += STEP * (4.0 * thrust / frame.mass - frame.gravity)
        z += STEP * v
        result.append(z)
    return times, np.array(result)


def away(gains: str) -> float:
    """Return the maximum distance [m] from the path when the pack is dropped in a wind of 25 m/s."""
    flight = fly("delivery_full", [*DROP, "run.duration=60.0", f"autopilot.gains={gains}"], TOPICS)
    n = min(len(flight.reference), len(flight.truth))
    return float(np.linalg.norm(flight.truth.position[:n] - flight.reference[:n, :3], axis=1).max())


def rebound(gains: str) -> float:
    """Return the maximum height [m] above the path after a downward gust."""
    flight = fly("hover", [*GUST, f"autopilot.gains={gains}"], TOPICS)
    n = min(len(flight.reference), len(flight.truth))
    over = flight.truth.position[:n, 2] - flight.reference[:n, 2]
    return float(over[flight.truth.times[:n] > 10.0].max())


def norm_errors_in_tumble() -> tuple[float, float]:
    """Return the norm error of the attitude quaternion with a motor out: in flight, and stepped from its rates."""
    truth = fly("hover", OUT).truth
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for wx, wy, wz in truth.angular_velocity:
        turn = np.array([[0, -wx, -wy, -wz], [wx, 0, wz, -wy], [wy, -wz, 0, wx], [wz, wy, -wx, 0]])
        q = q + 0.5 * STEP * turn @ q
    return float(np.abs(np.linalg.norm(truth.orientation, axis=1) - 1.0).max()), abs(float(np.linalg.norm(q)) - 1.0)


def run() -> CaseResult:
    """Measure the overshoot after a loss of thrust, a drop in wind, and the attitude of a vehicle that turns over."""
    t, ours = height(True, LOSS)
    _, baseline = height(False, LOSS)
    unit, stepped = norm_errors_in_tumble()
    rows = [
        Row(
            "thrust_loss",
            "integral held while the output is cut off",
            "overshoot [m] after half a second without thrust",
            OVERSHOOT,
            "less than the 2.5 m by which it falls: it comes back, and does not go on",
            float(ours.max()),
            "integral that goes on",
            float(baseline.max()),
        ),
        Row(
            "gust",
            "tuned gains, integral held",
            "height [m] over the path after 3 s of a gust of 25 m/s from above, motors at their limit",
            BACK,
            "a fifth of the 0.5 m by which it is pushed down",
            rebound("tuned"),
            "the paper's gains, without feed-forward",
            rebound("paper"),
        ),
        Row(
            "payload_drop",
            "tuned gains, integral held",
            "largest distance [m] from the path, 2 kg dropped in 25 m/s of wind",
            AWAY,
            "half the distance between two rotors across the vehicle",
            away("tuned"),
            "the paper's gains, without feed-forward",
            away("paper"),
        ),
        Row(
            "motor_out",
            "attitude on SO(3)",
            "length of the quaternion less one, with a motor out in hover",
            UNIT,
            "round-off, which must not add up while it tumbles",
            unit,
            "forward Euler on its numbers",
            stepped,
        ),
    ]
    curves = [Curve("integral held", t, ours), Curve("integral goes on", t, baseline)]
    return CaseResult(rows, Plot("time [s]", "height over the setpoint [m]", curves, OVERSHOOT, log_y=False))


def sweep() -> Sweep:
    """Increase the duration of the thrust loss: remaining error after 15 s."""
    losses = np.geomspace(0.1, 4.0, 25)
    result = {True: "integral held", False: "integral goes on"}
    curves = [
        Curve(name, losses, np.array([np.abs(height(is_limited, float(s))[1][-250:]).max() for s in losses]))
        for is_limited, name in result.items()
    ]
    return Sweep("seconds without thrust", "height error at the end [m]", 0.1, curves)
