"""Multibody engine: times with ratios to MuJoCo in one run, and error of the reduced model.

    python -m benchmarks.multibody [--json FILE]

Times are the best of interleaved repeats on one thread. MuJoCo (optional extra `bench`) steps the same five bodies with
its own RK4. The second part flies it with its real propellers and with symmetric ones (the reduced model).
"""

import json
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks._command import command_line
from lapwing.dynamics.integrators import get, integrate_fixed
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.multibody import augmented, five_bodies
from lapwing.dynamics.multibody.delivery_drone import DroneState, Flight, Loads, delivery_drone, motion
from lapwing.dynamics.multibody.delivery_drone import rate as delivery_drone_rate
from lapwing.dynamics.multibody.five_body_stabilisation import NONE, PARTITION, PROJECTION, advance, assembled_state
from lapwing.dynamics.multibody.mechanisms import drone_system
from lapwing.kernels import kernel
from lapwing.kernels.state_tree import axpy, embed

INERTIA = (9.8e-6, 8.6e-4, 8.6e-4)
PAPER = {
    "central_frame": 8.0, "payload": 2.0, "frame_inertia": (0.27, 0.26, 0.42), "propeller": 5.6e-3,
    "arm_length": 0.4974, "rotor_sign_x": (1, -1, -1, 1), "rotor_sign_y": (1, 1, -1, -1),
}  # fmt: skip
SPEEDS = (300.0, -300.0, 300.0, -300.0)
ANGLES = (0.1, 0.4, 0.7, 1.0)
ZERO3, ZERO4 = (0.0,) * 3, (0.0,) * 4
GRAVITY = (0.0, 0.0, -9.81)
START = DroneState((0.0, 0.0, 10.0), NO_ROTATION, ZERO3, (1.0, -0.7, 0.4), ANGLES, SPEEDS)
QUIET = Loads(ZERO3, ZERO3, ZERO4, ZERO4, ZERO4, GRAVITY)
METHOD, LIE = get("rk4_renormalised").Method(), get("rkmk4").Method()


@kernel
def general_solves(a, q, v, wrench, drive, n):
    total = 0.0
    for _ in range(n):
        v[0, 0] += 1e-9
        s, _ = augmented.solve(a, q, v, wrench, drive, 0.0, 0.0, augmented.RANK_TOLERANCE, augmented.ANY)
        total += s.acceleration[0, 0]
    return total


@kernel
def five_body_solves(p, x, n):
    for _ in range(n):
        x = axpy(1e-12, embed(x, five_bodies.rate(p, 0.0, x)), x)
    return x


@kernel
def least_solves(flight, x, n):
    # every number of the state changes, so that nothing can be moved out of the loop
    for _ in range(n):
        x = axpy(1e-12, embed(x, delivery_drone_rate(flight, 0.0, x)), x)
    return x


def mujoco_model(drone, step):
    import mujoco

    blade = " ".join(map(str, INERTIA))
    bodies = "".join(
        f'<body pos="{x} {y} {z}"><joint type="hinge" axis="0 0 1"/>'
        f'<inertial pos="0 0 0" mass="{drone.propeller_mass[0]}" diaginertia="{blade}"/></body>'
        for x, y, z in drone.hubs
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step}" integrator="RK4"/><worldbody><body><freejoint/>'
        f'<inertial pos="0 0 0" mass="{drone.mass}" diaginertia="0.27 0.26 0.42"/>{bodies}</body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    data.qpos[:] = [*START.position_world, *START.attitude, *START.angles]
    data.qvel[:] = [*START.velocity_world, *START.omega_body, *START.speeds]
    return model, data


def times(repeats=200):
    """Return seconds per call of each function, the best of interleaved repeats that are shorter than a time slice."""
    drone = delivery_drone(**PAPER, propeller_inertia=INERTIA)
    p = five_bodies.machine(drone, GRAVITY)
    x = assembled_state(p, five_bodies.BodyState(*START[:4]), ANGLES, SPEEDS)
    system, (q, v) = drone_system(drone), five_bodies.arrays(x)
    wrench, drive = np.zeros((5, 6)), np.array([[s, 0.0] for s in SPEEDS])
    flight, h = Flight(drone, QUIET), 1e-4
    contestants = {
        "general acceleration solve": (lambda n: general_solves(system.arrays, q, v.copy(), wrench, drive, n), 40),
        "fast path, five bodies": (lambda n: five_body_solves(p, x, n), 3000),
        "fast path, least coordinates": (lambda n: least_solves(flight, START, n), 3000),
        "five-body RK4 step": (lambda n: advance(METHOD, p, 0.0, x, h, n, NONE), 300),
        "five-body RK4 step, partitioning": (lambda n: advance(METHOD, p, 0.0, x, h, n, PARTITION), 200),
        "five-body RK4 step, projection": (lambda n: advance(METHOD, p, 0.0, x, h, n, PROJECTION), 200),
        "five-body RKMK4 step, projection": (lambda n: advance(LIE, p, 0.0, x, h, n, PROJECTION), 200),
        "least-coordinate RK4 step": (lambda n: integrate_fixed(METHOD, flight, 0.0, START, h, n), 1000),
    }
    try:
        import mujoco
        from mujoco import rollout

        model, data = mujoco_model(drone, h)
        state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        # rollout steps inside the library, without a Python call for each step
        contestants["MuJoCo RK4 step"] = (lambda n: rollout.rollout(model, data, state[None, :], nstep=n), 50)
    except ImportError:
        print("MuJoCo is not installed: pip install 'lapwing[bench]'")
    best = dict.fromkeys(contestants, np.inf)
    for run, n in contestants.values():
        run(n)
    for _ in range(repeats):
        for name, (run, n) in contestants.items():
            start = time.perf_counter()
            run(n)
            best[name] = min(best[name], (time.perf_counter() - start) / n)
    return best


def errors(h=1e-3, seconds=2.0):
    """Return the largest attitude error [-] against a step of h / 16: Lapwing (two methods) and MuJoCo."""
    drone = delivery_drone(**PAPER, propeller_inertia=INERTIA)
    n, flight = round(seconds / h), Flight(drone, QUIET)
    true = np.array(integrate_fixed(METHOD, flight, 0.0, START, h / 16, 16 * n).attitude)
    out = {"least coordinates": np.array(integrate_fixed(METHOD, flight, 0.0, START, h, n).attitude)}
    p = five_bodies.machine(drone, GRAVITY)
    x = assembled_state(p, five_bodies.BodyState(*START[:4]), ANGLES, SPEEDS)
    variants = {"projection": (METHOD, PROJECTION), "partitioning": (METHOD, PARTITION), "RKMK4": (LIE, PROJECTION)}
    for name, (method, stabilisation) in variants.items():
        end = advance(method, p, 0.0, x, h, n, stabilisation)
        out[f"five bodies, {name}"] = np.array(end.chassis.attitude)
    try:
        import mujoco

        model, data = mujoco_model(drone, h)
        for _ in range(n):
            mujoco.mj_step(model, data)
        out["MuJoCo"] = data.qpos[3:7].copy()
    except ImportError:
        pass
    return {name: float(min(np.abs(q - true).max(), np.abs(q + true).max())) for name, q in out.items()}


def left_out(speed, seconds=2.0, h=5e-5):
    """Return the differences of the reduced and the multibody model at a rotor speed [rad/s].

    Ripple of the rates [rad/s] and of the angular acceleration [rad/s^2], and attitude difference [deg] at the end of a
    tumble that starts at 1 rad/s.
    """
    mean = 0.5 * (INERTIA[0] + INERTIA[1])
    x = START._replace(speeds=tuple(np.sign(SPEEDS) * speed), angles=ZERO4)
    full = Flight(delivery_drone(**PAPER, propeller_inertia=INERTIA), QUIET)
    reduced = Flight(delivery_drone(**PAPER, propeller_inertia=(mean, mean, INERTIA[2])), QUIET)
    a, b, rates, accelerations = x, x, 0.0, 0.0
    for i in range(round(seconds / h / 10)):
        a, b = (integrate_fixed(METHOD, f, i * 10 * h, s, h, 10) for f, s in ((full, a), (reduced, b)))
        rates = max(rates, np.abs(np.subtract(a.omega_body, b.omega_body)).max())
        pair = [free_turn(f.drone, s) for f, s in ((full, a), (reduced, a))]
        accelerations = max(accelerations, np.abs(np.subtract(*pair)).max())
    turn = 2.0 * np.arccos(min(1.0, abs(np.dot(a.attitude, b.attitude))))
    return {"rate": float(rates), "acceleration": float(accelerations), "attitude_deg": float(np.degrees(turn))}


@kernel
def free_turn(drone, x):
    return motion(drone, QUIET, x).angular_acceleration_body


def main(figures: Annotated[Path | None, typer.Option("--json")] = None) -> None:
    best = times()
    best_other = best.get("MuJoCo RK4 step")
    print(f"{'':36}{'us':>9}{'MuJoCo / this':>15}")
    for name, seconds in best.items():
        ratio = f"{best_other / seconds:15.1f}" if best_other and "step" in name else ""
        print(f"{name:36}{1e6 * seconds:9.3f}{ratio}")
    wrong = errors()
    print("\nattitude error after 2 s at a step of 1 ms, 300 rad/s:")
    for name, value in wrong.items():
        print(f"  {name:34}{value:10.2e}")
    print("\nleft out by the reduced model (tumble from 1 rad/s, 2 s):")
    print(f"{'rotor speed [rad/s]':>22}{'rate [rad/s]':>14}{'accel. [rad/s^2]':>18}{'attitude [deg]':>16}")
    gap = {}
    for speed in (0.0, 1.0, 10.0, 100.0, 300.0):
        gap[speed] = left_out(speed)
        print(
            f"{speed:22.0f}{gap[speed]['rate']:14.2e}{gap[speed]['acceleration']:18.2e}{gap[speed]['attitude_deg']:16.2e}"
        )
    if figures:
        figures.write_text(json.dumps({"seconds": best, "errors": wrong, "left_out": gap}, indent=1))


if __name__ == "__main__":
    command_line(main)
