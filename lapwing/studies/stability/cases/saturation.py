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

HARD = "a gust of 25 m/s, loss of thrust for 0.5 s, a payload release in wind, a failed motor: saturated outputs"

STEP, LOSS_TIME, LOSS_DURATION = 0.004, 5.0, 0.5  # [s]
TOPICS = (TRUTH, SETPOINT, ACTUATORS, ESTIMATE, STATUS)
PAYLOAD_DROP = (
    "effects.payload_release.release_time=15.0",
    "effects.random_wind_force.mean=[25.0,0.0,0.0]",
    "effects.random_wind_force.sigma=2.0",
)
MOTOR_OUT = ("effects.rotor_damage.rotor=1", "effects.rotor_damage.time=5.0")
GUST = (
    "effects.wind_gust.peak=[0.0,0.0,-25.0]",
    "effects.wind_gust.start=10.0",
    "effects.wind_gust.duration=3.0",
    "effects.body_drag.area=[0.06,0.06,0.3]",
    'trajectory.phase.0.z={kind="minimum_jerk", to=10.0, duration=5.0}',
    "trajectory.phase.1.duration=20.0",
    "run.duration=24.0",
)  # downward, on a body large enough to saturate all motors
OVERSHOOT, REBOUND, DISTANCE, NORM = 1.0, 0.1, 0.5, 1e-12


def height(anti_windup: bool, loss: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (times [s], height over the setpoint [m]) of the altitude loop, without thrust for `loss` [s].

    `anti_windup` holds the integral while the output is saturated.
    """
    scene = load("hover", [])
    frame, gains = known_airframe(scene), pid.Pid(*scene[GainSet].altitude)
    thrust_max = thrust_at(frame.motor, frame.voltage_max)
    weight = 0.25 * frame.mass * frame.gravity
    integrate, output = python_function(pid.integrate), python_function(pid.output)
    z = v = integral = saturation = 0.0
    thrust, result = weight, []
    times = np.arange(0.0, 30.0, STEP)
    for t in times:
        integral = integrate(gains, integral, -z, saturation if anti_windup else 0.0, STEP)
        demand = weight + output(gains, integral, -z, -v)
        actual = min(max(demand, 0.0), thrust_max)
        saturation = float(np.sign(demand - actual))
        if LOSS_TIME <= t < LOSS_TIME + loss:
            actual = 0.0
        thrust += STEP / frame.motor.time_constant * (actual - thrust)
        v += STEP * (4.0 * thrust / frame.mass - frame.gravity)
        z += STEP * v
        result.append(z)
    return times, np.array(result)


def drop_distance(gains: str) -> float:
    """Return the largest distance [m] from the path after a payload release in wind of 25 m/s."""
    flight = fly("delivery_full", [*PAYLOAD_DROP, "run.duration=60.0", f"autopilot.gains={gains}"], TOPICS)
    n = min(len(flight.reference), len(flight.truth))
    return float(np.linalg.norm(flight.truth.position[:n] - flight.reference[:n, :3], axis=1).max())


def rebound(gains: str) -> float:
    """Return the maximum height [m] above the path after a downward gust."""
    flight = fly("hover", [*GUST, f"autopilot.gains={gains}"], TOPICS)
    n = min(len(flight.reference), len(flight.truth))
    over = flight.truth.position[:n, 2] - flight.reference[:n, 2]
    return float(over[flight.truth.times[:n] > 10.0].max())


def norm_errors_in_tumble() -> tuple[float, float]:
    """Return the norm errors of the quaternion with a failed motor, of the flight and of forward Euler on its rates."""
    truth = fly("hover", MOTOR_OUT).truth
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for wx, wy, wz in truth.angular_velocity:
        turn = np.array([[0, -wx, -wy, -wz], [wx, 0, wz, -wy], [wy, -wz, 0, wx], [wz, wy, -wx, 0]])
        q = q + 0.5 * STEP * turn @ q
    return float(np.abs(np.linalg.norm(truth.orientation, axis=1) - 1.0).max()), abs(float(np.linalg.norm(q)) - 1.0)


def run() -> CaseResult:
    """Measure overshoot after a loss of thrust, distances after a gust and a release, and the attitude of a tumble."""
    t, ours = height(True, LOSS_DURATION)
    _, baseline = height(False, LOSS_DURATION)
    norm, baseline_norm = norm_errors_in_tumble()
    rows = [
        Row("thrust_loss", "integral held during saturation", "overshoot [m] after 0.5 s without thrust", OVERSHOOT,
            "below the fall of 2.5 m, as without integrator windup", float(ours.max()), "integral without anti-windup",
            float(baseline.max())),
        Row("gust", "tuned gains, integral held",
            "height [m] over the path after a downward gust of 25 m/s for 3 s, motors saturated", REBOUND,
            "a fifth of the deflection of 0.5 m", rebound("tuned"), "gains of the paper, without feed-forward",
            rebound("paper")),
        Row("payload_drop", "tuned gains, integral held",
            "largest distance [m] from the path after the release of 2 kg in wind of 25 m/s", DISTANCE,
            "half the distance between opposite rotors", drop_distance("tuned"),
            "gains of the paper, without feed-forward", drop_distance("paper")),
        Row("motor_out", "attitude on SO(3)", "norm of the quaternion minus one, with a failed motor in hover", NORM,
            "round-off, which must not accumulate during the tumble", norm, "forward Euler on the components",
            baseline_norm),
    ]  # fmt: skip
    curves = [Curve("integral held", t, ours), Curve("no anti-windup", t, baseline)]
    return CaseResult(rows, Plot("time [s]", "height over the setpoint [m]", curves, OVERSHOOT, log_y=False))


def sweep() -> Sweep:
    """Increase the duration of the thrust loss: height error at the end of 30 s."""
    losses = np.geomspace(0.1, 4.0, 25)
    result = {True: "integral held", False: "no anti-windup"}
    curves = [
        Curve(name, losses, np.array([np.abs(height(anti_windup, float(s))[1][-250:]).max() for s in losses]))
        for anti_windup, name in result.items()
    ]
    return Sweep("duration without thrust [s]", "height error at the end [m]", 0.1, curves)
