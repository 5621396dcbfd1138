"""MuJoCo: its integrators over a range of steps, many steps in one call, contacts and constraints switched off."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from benchmarks.other_simulators.accuracy import matrix, outcome
from lapwing.studies.accuracy.problem import SolverMethod
from lapwing.studies.accuracy.systems import free_rigid_body, gyrostat, heavy_top

mujoco.set_mju_user_warning(lambda message: None)  # warnings about unstable steps, which are measured, too

NAME, MODULE = "MuJoCo", "mujoco"
INTEGRATORS = {"RK4": 4, "Euler": 1, "implicitfast": 1}
HALVINGS = 15
AXIAL, ACROSS = 10.0, 6.0  # [kg m^2] moments of a rotor of the gyrostat

OPTION = """<option timestep="0.001" integrator="{integrator}" gravity="0 0 {gravity}">
  <flag contact="disable" constraint="disable" eulerdamp="disable"/></option>"""


def free(integrator: str) -> str:
    inertia = " ".join(map(str, free_rigid_body.INERTIA))
    body = f'<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{inertia}"/></body>'
    return f"<mujoco>{OPTION.format(integrator=integrator, gravity=0)}<worldbody>{body}</worldbody></mujoco>"


def top(integrator: str) -> str:
    inertia = " ".join(map(str, heavy_top.CENTRAL_INERTIA))
    body = f"""<body><joint type="ball"/>
      <inertial pos="{heavy_top.ARM} 0 0" mass="{heavy_top.MASS}" diaginertia="{inertia}"/></body>"""
    option = OPTION.format(integrator=integrator, gravity=-heavy_top.GRAVITY)
    return f"<mujoco>{option}<worldbody>{body}</worldbody></mujoco>"


def satellite(integrator: str) -> str:
    """Return three free rotors: each keeps its axial momentum, so its axial inertia does not rotate along."""
    platform = " ".join(str(i - 2 * ACROSS) for i in gyrostat.STEADY.inertia)
    rotors = ""
    for i in range(3):
        axis = " ".join("1" if i == j else "0" for j in range(3))
        inertia = " ".join(str(AXIAL if i == j else ACROSS) for j in range(3))
        rotors += f"""<body><joint type="hinge" axis="{axis}"/>
          <inertial pos="0 0 0" mass="1" diaginertia="{inertia}"/></body>"""
    body = f"""<body><joint type="ball"/><inertial pos="0 0 0" mass="1" diaginertia="{platform}"/>{rotors}</body>"""
    return f"<mujoco>{OPTION.format(integrator=integrator, gravity=0)}<worldbody>{body}</worldbody></mujoco>"


def rotor_speeds() -> list[float]:
    p, omega = gyrostat.STEADY, gyrostat.START.omega_body
    return [h / AXIAL - o for h, o in zip(p.rotor_momentum, omega, strict=True)]


CASES: dict[str, tuple[Callable[[str], str], Any, slice, slice, float]] = {
    "free_rigid_body": (free, free_rigid_body, slice(3, 7), slice(3, 6), 0.5),
    "heavy_top": (top, heavy_top, slice(0, 4), slice(0, 3), 0.02),
    "gyrostat_steady": (satellite, gyrostat, slice(0, 4), slice(0, 3), 1.0),
}


def methods(case: str) -> list[SolverMethod]:
    describe, module, turn, omega, coarsest = CASES[case]

    def solver_method(integrator: str) -> SolverMethod:
        model = mujoco.MjModel.from_xml_string(describe(integrator))
        data = mujoco.MjData(model)

        def prepare(step: float) -> Callable[[], Any]:
            n = round(module.DURATION / step)

            def run() -> tuple[np.ndarray, np.ndarray]:
                mujoco.mj_resetData(model, data)
                data.qpos[turn], data.qvel[omega] = module.START.attitude, module.START.omega_body
                if case == "gyrostat_steady":
                    data.qvel[3:6] = rotor_speeds()
                model.opt.timestep = module.DURATION / n
                mujoco.mj_step(model, data, n)
                return data.qpos[turn].copy(), data.qvel[omega].copy()

            return run

        def read(step: float, end: Any) -> Any:
            return outcome(module.DURATION, matrix(end[0]), end[1])

        steps = [coarsest / 2**k for k in range(HALVINGS)]
        return SolverMethod(f"MuJoCo {integrator}", INTEGRATORS[integrator], "s", steps, prepare, read, lambda: None)

    return [solver_method(integrator) for integrator in INTEGRATORS]
