"""Time of a plant step in nanoseconds, with the ratio to hand-written C++ in the same run.

    python -m benchmarks.plant

Best of many short runs, which other work on the machine disturbs least; ratios are medians over pairs of consecutive
runs. "bare" is gravity, thrust and lag; its kernel "without the catalogue" is written by hand here without effects: the
ratio is the cost of inactive effects.
"""

import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks._command import command_line
from lapwing.dynamics import effects, noise
from lapwing.dynamics.effects._rotor_sums import total
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.integrators import get, rk4_renormalised
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY
from lapwing.dynamics.vehicles.newton_euler import angular_acceleration
from lapwing.kernels import always_inline, kernel

HERE = Path(__file__).parent
DRONE = load_airframe(HERE.parent / "lapwing/scenes/vehicles/delivery_drone.toml")
RK4 = get("rk4_renormalised").Method()
KEY = noise.stream_key(1, "drone1", "effects")
H, STEPS, REPETITIONS = 1e-3, 2000, 200  # short runs, most of which are not interrupted
HOVER = (31.6, 31.61, 31.62, 31.6)  # slightly different, so that all rotors and axes are involved

BARE = {"gravity": {}, "rotor_thrust": {}}
MISSION = BARE | {
    "air_density": {},
    "gyroscopic_torque": {},
    "random_wind_force": {"mean": [3.0, 1.0, 0.0]},
    "ground_contact": {},
}
EXCLUDED = (  # excluded by another effect of their kind, or not supported by the drone
    "battery_thevenin", "coaxial_interference", "gravity", "dynamic_inflow", "multirotor_ground_effect",
    "rotor_quadratic", "rotor_table", "wind_dryden_rates", "wind_von_karman",
)  # fmt: skip
ALL = {name: {} for name in effects.names() if name not in EXCLUDED} | {
    "ceiling_effect": {"height": 12.0},
    "shared_slung_load": {"mass": 2.0, "length": 3.0},
    "wind_constant": {"velocity": [3.0, 1.0, 0.0]},
    "wind_boundary_layer": {"speed": 5.0},
    "random_wind_force": {"allow_body_drag": True},
    "wind_gust": {"peak": [3.0, 0.0, 0.0], "start": 1.0, "duration": 1.0},
    "wind_dryden": {"wind_speed": 5.0, "airspeed": 5.0},
    "payload_release": {"release_time": 1.0},
    "rotor_damage": {"rotor": 1, "time": 1.0, "remaining_thrust": 0.95, "remaining_torque": 0.95},
}


@kernel
def exchanges(method, p, key, state, command, h, n, ticks):
    for tick in range(ticks):
        state = multirotor.advance(method, p, key, tick, state, command, h, n)
    return state


def nanoseconds_per_step(*runs):
    """Return ns per step, a row for each repetition; the runs alternate, so that other work affects all of them."""
    for run in runs:
        run()
    times = np.empty((REPETITIONS, len(runs)))
    for row in times:
        for i, run in enumerate(runs):
            start = time.thread_time()
            run()
            row[i] = time.thread_time() - start
    return times / STEPS * 1e9


def measure(tables, height, command, n):
    """Return ns per step with n steps in a communication step."""
    p = multirotor.parameters(DRONE, effects.from_scene(tables, DRONE))
    state = multirotor.initial_state(p, (0.0, 0.0, height), rotor_speed=330.0 if height > 1.0 else 0.0)
    return nanoseconds_per_step(lambda: exchanges(RK4, p, KEY, state, command, H, n, STEPS // n)).min()


@always_inline
def bare_rate(drive, t, m):
    p, v = drive
    layout, speed = p.layout, m.rotor_speed
    gravity, rotor = p.effects
    b, d = rotor.thrust_constant * STANDARD_DENSITY, rotor.torque_constant * STANDARD_DENSITY
    s = (speed[0] * speed[0], speed[1] * speed[1], speed[2] * speed[2], speed[3] * speed[3])
    f = (b * s[0], b * s[1], b * s[2], b * s[3])
    q = (d * s[0], d * s[1], d * s[2], d * s[3])
    x, y, sign = layout.x_body, layout.y_body, layout.reaction_sign
    torque = (
        (y[0] * f[0] + y[1] * f[1]) + (y[2] * f[2] + y[3] * f[3]),
        -((x[0] * f[0] + x[1] * f[1]) + (x[2] * f[2] + x[3] * f[3])),
        (sign[0] * q[0] + sign[1] * q[1]) + (sign[2] * q[2] + sign[3] * q[3]),
    )
    R, lift, k = rotation_matrix(m.attitude), total(f), p.body.inverse_mass
    acceleration = (k * (R[2] * lift), k * (R[5] * lift), k * (R[8] * lift - gravity.acceleration * p.body.mass))
    spin = angular_acceleration(p.body, m.omega_body, torque)
    a, r = layout.lag_rate, layout.speed_per_volt
    lag = (a * (r * v[0] - speed[0]), a * (r * v[1] - speed[1]), a * (r * v[2] - speed[2]), a * (r * v[3] - speed[3]))
    return Motion(m.velocity_world, m.omega_body, acceleration, spin, lag)


one_step = rk4_renormalised.step


@kernel
def bare_steps(p, motion, command, h, n):
    for i in range(n):
        motion = one_step(bare_rate, (p, command), i * h, motion, h)
    return motion


def bare():
    """Return ns per step with and without the catalogue, the ratio, and the final position."""
    p = multirotor.parameters(DRONE, effects.from_scene(BARE, DRONE))
    state = multirotor.initial_state(p, (0.0, 0.0, 10.0), rotor_speed=330.0)
    times = nanoseconds_per_step(
        lambda: exchanges(RK4, p, KEY, state, HOVER, H, STEPS, 1), lambda: bare_steps(p, state.motion, HOVER, H, STEPS)
    )
    reached = exchanges(RK4, p, KEY, state, HOVER, H, STEPS, 1).motion.position_world
    return *times.min(axis=0), np.median(times[:, 0] / times[:, 1]), reached


def cpp_reference():
    """Return (ns per step of the C++ reference, final position); None without a compiler."""
    if not shutil.which("g++"):
        return None
    p = multirotor.parameters(DRONE, effects.from_scene(BARE, DRONE))
    density, rotor = STANDARD_DENSITY, p.effects[1]
    numbers = [
        p.body.mass, *p.body.inertia, *p.layout.x_body, *p.layout.y_body, *p.layout.reaction_sign,
        rotor.thrust_constant * density, rotor.torque_constant * density, p.effects[0].acceleration, p.layout.lag_rate,
        *(p.layout.speed_per_volt * v for v in HOVER), H, 10.0, 330.0,
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "plant"
        flags = ["-O3", "-march=native", "-ffp-contract=off", "-std=c++17"]
        subprocess.run(["g++", *flags, str(HERE / "plant.cpp"), "-o", str(program)], check=True)
        arguments = [str(program), str(STEPS), str(REPETITIONS)]
        text = subprocess.run(
            arguments, input=" ".join(map(repr, numbers)), capture_output=True, text=True, check=True
        ).stdout.split()
    return float(text[0]), tuple(map(float, text[1:]))


def main() -> None:
    with_catalogue, without, inactive, reached = bare()
    rows = [
        ("bare", with_catalogue),
        ("bare, kernel without the catalogue", without),
        ("mission, airborne", measure(MISSION, 2000.0, HOVER, STEPS)),
        ("mission, airborne, exchange every 4 steps", measure(MISSION, 2000.0, HOVER, 4)),
        ("mission, standing", measure(MISSION, 0.35, (0.0,) * 4, STEPS)),
        (f"{len(ALL)} effects, airborne", measure(ALL, 2000.0, HOVER, STEPS)),
        (f"{len(ALL)} effects, airborne, exchange every 4 steps", measure(ALL, 2000.0, HOVER, 4)),
        (f"{len(ALL)} effects, standing", measure(ALL, 0.35, (0.0,) * 4, STEPS)),
    ]
    other = cpp_reference()
    if other:
        rows.append(("bare, hand-written C++ (g++ -O3)", other[0]))
        error = max(abs(a - b) for a, b in zip(reached, other[1], strict=True))
        print(f"C++ and plant end {error:.1e} m apart after {STEPS} steps")
    reference = other[0] if other else without
    print(f"{'RK4 step of the plant':55}   ns  ratio to {'C++' if other else 'bare'}")
    for name, value in rows:
        print(f"{name:55} {value:5.1f}  {value / reference:5.2f}")
    print(f"inactive effects: {inactive:.3f} times the kernel without the catalogue")


if __name__ == "__main__":
    command_line(main)
