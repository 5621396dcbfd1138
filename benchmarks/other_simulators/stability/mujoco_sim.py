"""MuJoCo: free bodies by each of its integrators, a vehicle on feet on a plane, four-bars closed by equalities."""

import math
from functools import partial
from typing import Any

import mujoco
import numpy as np

from benchmarks.other_simulators.stability import Errors, _ball_feet, _free_bodies
from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.stability.cases import landing, redundant_constraints, slopes, toppling

INTEGRATORS = ("RK4", "implicitfast")
CONTACT = "MuJoCo implicitfast, elliptic cone"

mujoco.set_mju_user_warning(lambda message: None)  # warnings about instability, which is measured


def free(integrator: str, inertia: Any, start: Any, duration: float, steps: int, samples: int) -> np.ndarray:
    """Return R_world_body and omega_body of a free body at equidistant times, shape (samples + 1, 12)."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{duration / steps!r}" integrator="{integrator}" gravity="0 0 0"/>
      <worldbody><body><freejoint/>
        <inertial pos="0 0 0" mass="1" diaginertia="{" ".join(map(repr, inertia))}"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qpos[3:7], data.qvel[3:6] = start.attitude, start.omega_body
    q, omega = [np.array(start.attitude)], [np.array(start.omega_body)]
    for _ in range(samples):
        mujoco.mj_step(model, data, steps // samples)
        q.append(data.qpos[3:7].copy())
        omega.append(data.qvel[3:6].copy())
    return np.hstack([matrices(np.array(q)), np.array(omega)])


def vehicle(angle: float, friction: float) -> tuple[Any, Any]:
    """Return (model, data) of the delivery drone on four balls, on a plane that rises along y by an angle [rad]."""
    mass, size = landing.DRONE.mass, _ball_feet.RADIUS
    balls = "".join(f'<geom size="{size}" pos="{x} {y} {z}" mass="0"/>' for x, y, z in _ball_feet.BALLS)
    lean = f"0 {-landing.G * math.sin(angle)!r} {-landing.G * math.cos(angle)!r}"
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{landing.STEP}" integrator="implicitfast" cone="elliptic" gravity="{lean}"/>
      <default><geom friction="{friction} 0 0" condim="3"/></default>
      <worldbody><geom type="plane" size="50 50 1"/>
        <body pos="0 0 {landing.HEIGHT}"><freejoint/>
          <inertial pos="0 0 0" mass="{mass.total}" diaginertia="{" ".join(map(repr, mass.inertia))}"/>{balls}
        </body></worldbody></mujoco>""")
    return model, mujoco.MjData(model)


def run_on(model: Any, data: Any, seconds: float) -> Any:
    """Return the data after `seconds`."""
    mujoco.mj_step(model, data, round(seconds / landing.STEP))
    return data


def creep_distance(angle: float, seconds: float) -> float:
    """Return the distance [m] that it moves on a slope [rad] after 3 s at rest."""
    model, data = vehicle(angle, slopes.STATIC)
    before = run_on(model, data, 3.0).qpos[:3].copy()
    return float(np.linalg.norm(run_on(model, data, seconds).qpos[:3] - before))


def standing() -> Errors:
    """Return the creep on a slope, and the motion after a slide."""
    model, data = vehicle(0.0, slopes.DYNAMIC)
    run_on(model, data, 3.0).qvel[0] = 1.0
    left = float(np.abs(run_on(model, data, 2.0).qvel[:3]).max())
    return {"creep": {CONTACT: creep_distance(math.radians(20.0), 600.0)}, "stick_slip": {CONTACT: left}}


def sliding() -> Errors:
    """Return the motion below and above the friction angle."""
    a = math.radians(30.0)
    model, data = vehicle(a, slopes.DYNAMIC)
    early = run_on(model, data, 0.3).qvel[:3].copy()
    late = run_on(model, data, 0.5).qvel[:3]
    exact = landing.G * (math.sin(a) - slopes.DYNAMIC * math.cos(a))
    off = abs(float(np.linalg.norm(late - early)) / 0.5 / exact - 1.0)
    return {
        "below": {CONTACT: creep_distance(math.radians(slopes.EDGE - slopes.MARGIN), 60.0)},
        "beyond": {CONTACT: off},
    }


def falls(axis: int, angle: float) -> bool:
    """Return True if a tilted vehicle topples."""
    model, data = vehicle(0.0, slopes.STATIC)
    data.qpos[2], data.qpos[3:7] = _ball_feet.set_down(axis, angle)
    data = run_on(model, data, toppling.SECONDS)
    return _ball_feet.toppled(axis, 1.0 - 2.0 * (data.qpos[4] ** 2 + data.qpos[5] ** 2))


def leaning() -> Errors:
    """Return the error of the toppling angle."""
    return {"leaning": {CONTACT: _ball_feet.error(falls)}}


def four_bars(n: int = 2) -> Errors:
    """Return the error of two windows: couplers hang on their left crank and are tied to the right one."""
    c = redundant_constraints
    rod = '<inertial pos="0.5 0 0" mass="1" diaginertia="0.0001 0.0833333333333333 0.0833333333333333"/>'
    hinge = '<joint type="hinge" axis="0 0 1"/>'
    cranks, ties = "", ""
    for k in range(n + 1):
        coupler = f'<body name="coupler{k}" pos="1 0 0" euler="0 0 -90">{hinge}{rod}</body>' if k < n else ""
        cranks += f'<body name="crank{k}" pos="{k} 0 0" euler="0 0 90">{hinge}{rod}{coupler}</body>'
    for k in range(n):
        ties += f'<connect body1="coupler{k}" body2="crank{k + 1}" anchor="1 0 0"/>'
    step = c.END / c.STEPS
    result = {}
    for name, stiff in (("MuJoCo RK4", "0.02"), ("MuJoCo RK4, solref of two steps", f"{2.0 * step:g}")):
        model = mujoco.MjModel.from_xml_string(f"""<mujoco>
          <option timestep="{step}" integrator="RK4" gravity="0 {-c.GRAVITY} 0"/>
          <default><equality solref="{stiff} 1"/></default>
          <worldbody>{cranks}</worldbody><equality>{ties}</equality></mujoco>""")
        data = mujoco.MjData(model)
        data.qvel[:] = [-1.0, 1.0] * n + [-1.0]  # tips at 1 m/s, couplers do not turn
        tip = []
        for _ in range(c.STEPS // c.RECORD_EVERY):
            mujoco.mj_step(model, data, c.RECORD_EVERY)
            mujoco.mj_kinematics(model, data)
            tip.append(2.0 * data.body("crank0").xipos)
        t = np.linspace(0.0, c.END, len(tip) + 1)
        result[name] = float(np.abs(np.array(tip) - c.tips(t, n)[1:]).max())
    return {"four_bar": result}


CASES = {
    **_free_bodies.cases({f"MuJoCo {name}": partial(free, name) for name in INTEGRATORS}),
    "landing": standing,
    "slopes": sliding,
    "toppling": leaning,
    "redundant_constraints": four_bars,
}
