"""MuJoCo: its integrators on free bodies and a top, a vehicle on feet on a plane, four-bars closed by equalities."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np

from benchmarks._simulators import Errors, _cases, matrix, outcome
from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.accuracy.problem import SolverMethod
from lapwing.studies.accuracy.systems import free_rigid_body, gyrostat, heavy_top
from lapwing.studies.stability.cases import landing, redundant_constraints

mujoco.set_mju_user_warning(lambda message: None)  # warnings about unstable steps, which are measured, too

NAME, MODULE = "MuJoCo", "mujoco"
ORDERS = {"RK4": 4, "Euler": 1, "implicitfast": 1}
HALVINGS = 15
AXIAL, ACROSS = 10.0, 6.0  # [kg m^2] moments of a rotor of the gyrostat
FREE_OF_FORCES = '<flag contact="disable" constraint="disable" eulerdamp="disable"/>'


def text(values: Sequence[float]) -> str:
    return " ".join(map(repr, map(float, values)))


def inertial(inertia: Sequence[float], mass: float = 1.0, place: Sequence[float] = (0.0, 0.0, 0.0)) -> str:
    """Return the element of a body's mass [kg], centre [m] and principal moments about it [kg m^2]."""
    return f'<inertial pos="{text(place)}" mass="{mass}" diaginertia="{text(inertia)}"/>'


def model_of(
    world: str, step: float, integrator: str, gravity: Sequence[float] = (0.0, 0.0, 0.0), flags: str = "", **more: str
) -> Any:
    """Return the model of a world's elements; `more` are other elements by name, and `cone`."""
    cone = f' cone="{more.pop("cone")}"' if "cone" in more else ""
    others = "".join(f"<{name}>{content}</{name}>" for name, content in more.items())
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step!r}" integrator="{integrator}" gravity="{text(gravity)}"{cone}>{flags}'
        f"</option><worldbody>{world}</worldbody>{others}</mujoco>"
    )


def satellite() -> str:
    """Return three free rotors: each keeps its axial momentum, so its axial inertia does not rotate along."""
    platform = inertial([i - 2 * ACROSS for i in gyrostat.STEADY.inertia])
    rotors = "".join(
        f'<body><joint type="hinge" axis="{text(axis)}"/>{inertial(ACROSS + (AXIAL - ACROSS) * axis)}</body>'
        for axis in np.eye(3)
    )
    return f'<body><joint type="ball"/>{platform}{rotors}</body>'


TOP = inertial(heavy_top.CENTRAL_INERTIA, heavy_top.MASS, (heavy_top.ARM, 0.0, 0.0))
# world, downward gravity [m/s^2], module, columns of attitude and rate, coarsest step [s or min]
PROBLEMS: dict[str, tuple[str, float, Any, slice, slice, float]] = {
    "free_rigid_body": (
        f"<body><freejoint/>{inertial(free_rigid_body.INERTIA)}</body>",
        *(0.0, free_rigid_body, slice(3, 7), slice(3, 6), 0.5),
    ),
    "heavy_top": (
        f'<body><joint type="ball"/>{TOP}</body>',
        *(heavy_top.GRAVITY, heavy_top, slice(0, 4), slice(0, 3), 0.02),
    ),
    "gyrostat_steady": (satellite(), 0.0, gyrostat, slice(0, 4), slice(0, 3), 1.0),
}


def rotor_speeds() -> list[float]:
    p, omega = gyrostat.STEADY, gyrostat.START.omega_body
    return [h / AXIAL - o for h, o in zip(p.rotor_momentum, omega, strict=True)]


def methods(case: str) -> list[SolverMethod]:
    world, gravity, module, turn, omega, coarsest = PROBLEMS[case]

    def solver_method(integrator: str) -> SolverMethod:
        model = model_of(world, 0.001, integrator, (0.0, 0.0, -gravity), FREE_OF_FORCES)
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
        return SolverMethod(f"MuJoCo {integrator}", ORDERS[integrator], "s", steps, prepare, read, lambda: None)

    return [solver_method(integrator) for integrator in ORDERS]


def free(integrator: str, inertia: Any, start: Any, duration: float, steps: int, samples: int) -> np.ndarray:
    """Return R_world_body and omega_body of a free body at equidistant times, shape (samples + 1, 12)."""
    model = model_of(f"<body><freejoint/>{inertial(inertia)}</body>", duration / steps, integrator)
    data = mujoco.MjData(model)
    data.qpos[3:7], data.qvel[3:6] = start.attitude, start.omega_body
    q, omega = [np.array(start.attitude)], [np.array(start.omega_body)]
    for _ in range(samples):
        mujoco.mj_step(model, data, steps // samples)
        q.append(data.qpos[3:7].copy())
        omega.append(data.qvel[3:6].copy())
    return np.hstack([matrices(np.array(q)), np.array(omega)])


class Vehicle:
    """The delivery drone on four balls, on a plane that rises along y by an angle [rad]."""

    def __init__(self, angle: float, friction: float) -> None:
        mass, g = landing.DRONE.mass, landing.G
        balls = "".join(f'<geom size="{_cases.RADIUS}" pos="{text(ball)}" mass="0"/>' for ball in _cases.BALLS)
        world = f"""<geom type="plane" size="50 50 1"/><body pos="0 0 {landing.HEIGHT}"><freejoint/>
          {inertial(mass.inertia, mass.total)}{balls}</body>"""
        self.model = model_of(
            world, landing.STEP, "implicitfast", (0.0, -g * math.sin(angle), -g * math.cos(angle)), cone="elliptic",
            default=f'<geom friction="{friction} 0 0" condim="3"/>',
        )  # fmt: skip
        self.data = mujoco.MjData(self.model)

    def run_on(self, seconds: float) -> None:
        mujoco.mj_step(self.model, self.data, round(seconds / landing.STEP))

    def attitude_matrix(self) -> np.ndarray:
        return matrix(self.data.qpos[3:7])

    def position_world(self) -> np.ndarray:
        return self.data.qpos[:3].copy()

    def velocity_world(self) -> np.ndarray:
        return self.data.qvel[:3].copy()

    def push(self, velocity_world: list[float]) -> None:
        self.data.qvel[:3] = velocity_world

    def put(self, height: float, attitude: tuple[float, ...]) -> None:
        self.data.qpos[2], self.data.qpos[3:7] = height, attitude


def four_bars(n: int = 2) -> Errors:
    """Return the error of two windows: couplers hang on their left crank and are tied to the right one."""
    c = redundant_constraints
    rod = inertial((1e-4, 1.0 / 12.0, 1.0 / 12.0), place=(0.5, 0.0, 0.0))
    hinge = '<joint type="hinge" axis="0 0 1"/>'
    cranks, ties = "", ""
    for k in range(n + 1):
        coupler = f'<body name="coupler{k}" pos="1 0 0" euler="0 0 -90">{hinge}{rod}</body>' if k < n else ""
        cranks += f'<body name="crank{k}" pos="{k} 0 0" euler="0 0 90">{hinge}{rod}{coupler}</body>'
    for k in range(n):
        ties += f'<connect body1="coupler{k}" body2="crank{k + 1}" anchor="1 0 0"/>'
    step, result = c.END / c.STEPS, {}
    for name, stiff in (("MuJoCo RK4", "0.02"), ("MuJoCo RK4, solref of two steps", f"{2.0 * step:g}")):
        default = f'<equality solref="{stiff} 1"/>'
        model = model_of(cranks, step, "RK4", (0.0, -c.GRAVITY, 0.0), default=default, equality=ties)
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
    **_cases.free_body_cases({f"MuJoCo {name}": partial(free, name) for name in ("RK4", "implicitfast")}),
    **_cases.vehicle_cases("MuJoCo implicitfast, elliptic cone", Vehicle),
    "redundant_constraints": four_bars,
}
