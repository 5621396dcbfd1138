"""Drake: bodies with error-controlled and fixed steps and as a discrete plant, a vehicle on a plane, four-bars."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    QuaternionFloatingJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder

from benchmarks._simulators import Errors, _cases, matrix, outcome
from benchmarks._simulators.mujoco_sim import ACROSS, AXIAL, rotor_speeds
from lapwing.studies.accuracy.problem import SolverMethod
from lapwing.studies.accuracy.systems import free_rigid_body, gyrostat, heavy_top
from lapwing.studies.stability.cases import landing, redundant_constraints

NAME, MODULE = "Drake", "drake"
ORDERS = {"runge_kutta3": 3, "runge_kutta5": 5}
TOLERANCES = tuple(10.0**-k for k in range(1, 14))
PROBLEMS = {"free_rigid_body": free_rigid_body, "heavy_top": heavy_top, "gyrostat_steady": gyrostat}
DISCRETE = "Drake discrete"
SCHEMES = {"Drake RK3": "runge_kutta3", "Drake RK5": "runge_kutta5", DISCRETE: None}  # None: a discrete plant


def add_body(plant: MultibodyPlant, name: str, mass: float, inertia: Any, centre: Any = (0.0, 0.0, 0.0)) -> Any:
    """Add a body with principal moments [kg m^2] about its centre of mass [m]."""
    unit = UnitInertia(*(i / mass for i in inertia)).ShiftFromCenterOfMass(centre)
    return plant.AddRigidBody(name, SpatialInertia(mass, centre, unit))


def float_freely(plant: MultibodyPlant, body: Any) -> Any:
    return plant.AddJoint(QuaternionFloatingJoint("free", plant.world_frame(), body.body_frame()))


def plant_of(case: str) -> tuple[MultibodyPlant, Any, list[Any]]:
    """Return (plant, body, rotor joints)."""
    plant, rotors = MultibodyPlant(0.0), []
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -heavy_top.GRAVITY if case == "heavy_top" else 0.0])
    if case == "free_rigid_body":
        body = add_body(plant, "body", 1.0, free_rigid_body.INERTIA)
        float_freely(plant, body)
    elif case == "heavy_top":
        body = add_body(plant, "body", heavy_top.MASS, heavy_top.CENTRAL_INERTIA, [heavy_top.ARM, 0.0, 0.0])
        plant.AddJoint(BallRpyJoint("pivot", plant.world_frame(), body.body_frame()))
    else:
        body = add_body(plant, "body", 1.0, [i - 2 * ACROSS for i in gyrostat.STEADY.inertia])
        float_freely(plant, body)
        for i, axis in enumerate(np.eye(3)):
            rotor = add_body(plant, f"rotor{i}", 1.0, ACROSS + (AXIAL - ACROSS) * axis)
            rotors.append(plant.AddJoint(RevoluteJoint(f"axis{i}", body.body_frame(), rotor.body_frame(), axis)))
    plant.Finalize()
    return plant, body, rotors


def methods(case: str) -> list[SolverMethod]:
    module = PROBLEMS[case]
    R_start = matrix(np.array(module.START.attitude))
    omega_start = np.array(module.START.omega_body)

    def solver_method(scheme: str) -> SolverMethod:
        plant, body, rotors = plant_of(case)
        simulator = Simulator(plant)
        context = simulator.get_mutable_context()

        def restart() -> None:
            context.SetTime(0.0)
            joint = plant.GetJointByName("pivot" if case == "heavy_top" else "free")
            if case == "heavy_top":
                joint.set_angles(context, RollPitchYaw(RotationMatrix(R_start)).vector())
            else:
                joint.SetQuaternion(context, Quaternion(np.array(module.START.attitude)))
            joint.set_angular_velocity(context, R_start @ omega_start)
            for rotor, speed in zip(rotors, rotor_speeds(), strict=False):
                rotor.set_angle(context, 0.0)
                rotor.set_angular_rate(context, speed)

        def prepare(tolerance: float) -> Callable[[], Any]:
            longest = 0.01 * module.DURATION
            config = SimulatorConfig(
                integration_scheme=scheme, accuracy=tolerance, max_step_size=longest, use_error_control=True
            )

            def run() -> Any:
                restart()
                ApplySimulatorConfig(config, simulator)
                simulator.Initialize()
                simulator.AdvanceTo(module.DURATION)
                R = plant.EvalBodyPoseInWorld(context, body).rotation().matrix()
                return R, R.T @ plant.EvalBodySpatialVelocityInWorld(context, body).rotational()

            return run

        def read(tolerance: float, end: Any) -> Any:
            return outcome(module.DURATION, *end)

        return SolverMethod(f"Drake {scheme}", ORDERS[scheme], "tol", TOLERANCES, prepare, read, lambda: None)

    return [solver_method(scheme) for scheme in ORDERS]


class Model:
    """Plant with its simulator after `finish`, and the position of its state."""

    def __init__(self, step: float, scheme: str | None, gravity_world: tuple[float, float, float]) -> None:
        self.builder, self.step, self.scheme = DiagramBuilder(), step, scheme
        config = MultibodyPlantConfig(time_step=0.0 if scheme else step)
        self.plant, _ = AddMultibodyPlant(config, self.builder)
        self.plant.mutable_gravity_field().set_gravity_vector(gravity_world)

    def add_free_body(self, mass: float, inertia: Any) -> Any:
        """Add a body with six degrees of freedom."""
        self.body = add_body(self.plant, "body", mass, inertia)
        self.joint = float_freely(self.plant, self.body)
        return self.body

    def finish(self) -> None:
        """Finish the plant, and create the simulator at time 0."""
        self.plant.Finalize()
        self.simulator = Simulator(self.builder.Build())
        if self.scheme:
            equal = SimulatorConfig(integration_scheme=self.scheme, max_step_size=self.step, use_error_control=False)
            ApplySimulatorConfig(equal, self.simulator)
        self.context = self.plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())

    def run_on(self, seconds: float) -> None:
        """Advance the simulation by `seconds`."""
        self.simulator.AdvanceTo(self.simulator.get_context().get_time() + seconds)

    def attitude_matrix(self) -> np.ndarray:
        """Return R_world_body of the free body, shape (3, 3)."""
        return np.array(self.plant.EvalBodyPoseInWorld(self.context, self.body).rotation().matrix())

    def position_world(self) -> np.ndarray:
        """Return the position of the free body [m], world, shape (3,)."""
        return np.array(self.joint.get_translation(self.context))

    def velocity_world(self) -> np.ndarray:
        """Return the velocity of the free body [m/s], world, shape (3,)."""
        return np.array(self.joint.get_translational_velocity(self.context))

    def push(self, velocity_world: list[float]) -> None:
        """Set the velocity of the free body [m/s]."""
        self.joint.set_translational_velocity(self.context, velocity_world)

    def put(self, height: float, attitude: tuple[float, ...]) -> None:
        """Set the height [m] and the attitude (quaternion wxyz) of the free body."""
        self.joint.SetTranslation(self.context, [0.0, 0.0, height])
        self.joint.SetQuaternion(self.context, Quaternion(np.array(attitude)))


def free(scheme: str | None, inertia: Any, start: Any, duration: float, steps: int, samples: int) -> np.ndarray:
    """Return R_world_body and omega_body of a free body at equidistant times, shape (samples + 1, 12)."""
    model = Model(duration / steps, scheme, (0.0, 0.0, 0.0))
    body = model.add_free_body(1.0, inertia)
    model.finish()
    model.joint.SetQuaternion(model.context, Quaternion(np.array(start.attitude)))
    model.joint.set_angular_velocity(model.context, model.attitude_matrix() @ start.omega_body)
    result = []
    for t in np.linspace(0.0, duration, samples + 1):
        model.simulator.AdvanceTo(t)
        R = model.attitude_matrix()
        omega_world = model.plant.EvalBodySpatialVelocityInWorld(model.context, body).rotational()
        result.append(np.append(R, R.T @ omega_world))
    return np.array(result)


def vehicle(angle: float, friction: float) -> Model:
    """Return the delivery drone on four balls, on a plane that rises along y by an angle [rad]."""
    model = Model(landing.STEP, None, (0.0, -landing.G * math.sin(angle), -landing.G * math.cos(angle)))
    plant, mass, grip = model.plant, landing.DRONE.mass, CoulombFriction(friction, friction)
    body = model.add_free_body(mass.total, mass.inertia)
    below = RigidTransform([0.0, 0.0, -0.5])  # a half space would cause a warning about deformable bodies
    plant.RegisterCollisionGeometry(plant.world_body(), below, Box(100.0, 100.0, 1.0), "ground", grip)
    for k, middle in enumerate(_cases.BALLS):
        ball = Sphere(_cases.RADIUS)
        plant.RegisterCollisionGeometry(body, RigidTransform(middle), ball, f"foot{k}", grip)
    model.finish()
    model.joint.SetTranslation(model.context, [0.0, 0.0, landing.HEIGHT])
    return model


def four_bars(n: int = 2) -> Errors:
    """Return the error of two windows: couplers hang on their left crank and are tied to the right one."""
    c = redundant_constraints
    model = Model(c.END / c.STEPS, None, (0.0, -c.GRAVITY, 0.0))
    plant, joints, cranks, couplers = model.plant, [], [], []
    rod, middle, tip = (1e-4, 1.0 / 12.0, 1.0 / 12.0), [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]

    def hinge(name: str, parent: Any, place: list[float], angle: float, rate: float) -> Any:
        body = add_body(plant, name, 1.0, rod, middle)
        on_parent = plant.AddFrame(FixedOffsetFrame(f"{name}_axis", parent.body_frame(), RigidTransform(place)))
        joint = RevoluteJoint(name, on_parent, body.body_frame(), [0.0, 0.0, 1.0])
        joints.append((plant.AddJoint(joint), angle, rate))
        return body

    for k in range(n + 1):  # cranks upright, tips at 1 m/s, couplers do not turn
        cranks.append(hinge(f"crank{k}", plant.world_body(), [k, 0.0, 0.0], 0.5 * math.pi, -1.0))
        if k < n:
            couplers.append(hinge(f"coupler{k}", cranks[k], tip, -0.5 * math.pi, 1.0))
    for k in range(n):
        plant.AddBallConstraint(couplers[k], tip, cranks[k + 1], tip)
    model.finish()
    for joint, angle, rate in joints:
        joint.set_angle(model.context, angle)
        joint.set_angular_rate(model.context, rate)
    t = np.linspace(0.0, c.END, c.STEPS // c.RECORD_EVERY + 1)
    off = []
    for at, exact in zip(t[1:], c.tips(t, n)[1:], strict=True):
        model.simulator.AdvanceTo(at)
        off.append(np.abs(plant.EvalBodyPoseInWorld(model.context, cranks[0]) @ np.array(tip) - exact).max())
    return {"four_bar": {DISCRETE: float(max(off))}}


CASES = {
    **_cases.free_body_cases({name: partial(free, scheme) for name, scheme in SCHEMES.items()}),
    **_cases.vehicle_cases(DISCRETE, vehicle),
    "redundant_constraints": four_bars,
}
