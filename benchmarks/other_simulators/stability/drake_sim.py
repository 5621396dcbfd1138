"""Drake: free bodies with fixed steps and as a discrete plant, a vehicle on a plane, four-bars with constraints."""

import math
from functools import partial
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import FixedOffsetFrame, QuaternionFloatingJoint, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder

from benchmarks.other_simulators.stability import Errors, _ball_feet, _free_bodies
from lapwing.studies.stability.cases import landing, redundant_constraints, slopes, toppling

DISCRETE = "Drake discrete"
SCHEMES = {"Drake RK3": "runge_kutta3", "Drake RK5": "runge_kutta5", DISCRETE: None}  # None: a discrete plant


class Model:
    """Plant with its simulator after `finish`, and the position of its state."""

    def __init__(self, step: float, scheme: str | None, gravity_world: tuple[float, float, float]) -> None:
        self.builder, self.step, self.scheme = DiagramBuilder(), step, scheme
        config = MultibodyPlantConfig(time_step=0.0 if scheme else step)
        self.plant, _ = AddMultibodyPlant(config, self.builder)
        self.plant.mutable_gravity_field().set_gravity_vector(gravity_world)

    def add_body(self, name: str, mass: float, inertia: tuple[float, float, float], middle: Any = (0, 0, 0)) -> Any:
        """Add a body with principal moments [kg m^2] about its centre of mass at `middle` [m]."""
        unit = UnitInertia(*(i / mass for i in inertia)).ShiftFromCenterOfMass(middle)
        return self.plant.AddRigidBody(name, SpatialInertia(mass, middle, unit))

    def add_free_body(self, mass: float, inertia: tuple[float, float, float]) -> Any:
        """Add a body with six degrees of freedom."""
        self.body = self.add_body("body", mass, inertia)
        self.joint = self.plant.AddJoint(
            QuaternionFloatingJoint("free", self.plant.world_frame(), self.body.body_frame())
        )
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
    for k, middle in enumerate(_ball_feet.BALLS):
        ball = Sphere(_ball_feet.RADIUS)
        plant.RegisterCollisionGeometry(body, RigidTransform(middle), ball, f"foot{k}", grip)
    model.finish()
    model.joint.SetTranslation(model.context, [0.0, 0.0, landing.HEIGHT])
    return model


def creep_distance(angle: float, seconds: float) -> float:
    """Return the distance [m] that it moves on a slope [rad] after 3 s at rest."""
    model = vehicle(angle, slopes.STATIC)
    model.run_on(3.0)
    before = model.position_world()
    model.run_on(seconds)
    return float(np.linalg.norm(model.position_world() - before))


def standing() -> Errors:
    """Return the creep on a slope, and the motion after a slide."""
    model = vehicle(0.0, slopes.DYNAMIC)
    model.run_on(3.0)
    model.joint.set_translational_velocity(model.context, [1.0, 0.0, 0.0])
    model.run_on(2.0)
    left = float(np.abs(model.velocity_world()).max())
    return {"creep": {DISCRETE: creep_distance(math.radians(20.0), 600.0)}, "stick_slip": {DISCRETE: left}}


def sliding() -> Errors:
    """Return the motion below and above the friction angle."""
    a = math.radians(30.0)
    model = vehicle(a, slopes.DYNAMIC)
    model.run_on(0.3)
    early = model.velocity_world()
    model.run_on(0.5)
    exact = landing.G * (math.sin(a) - slopes.DYNAMIC * math.cos(a))
    off = abs(float(np.linalg.norm(model.velocity_world() - early)) / 0.5 / exact - 1.0)
    return {
        "below": {DISCRETE: creep_distance(math.radians(slopes.EDGE - slopes.MARGIN), 60.0)},
        "beyond": {DISCRETE: off},
    }


def falls(axis: int, angle: float) -> bool:
    """Return True if a tilted vehicle topples."""
    model = vehicle(0.0, slopes.STATIC)
    height, attitude = _ball_feet.set_down(axis, angle)
    model.joint.SetTranslation(model.context, [0.0, 0.0, height])
    model.joint.SetQuaternion(model.context, Quaternion(np.array(attitude)))
    model.run_on(toppling.SECONDS)
    return _ball_feet.toppled(axis, model.attitude_matrix()[2, 2])


def leaning() -> Errors:
    """Return the error of the toppling angle."""
    return {"leaning": {DISCRETE: _ball_feet.error(falls)}}


def four_bars(n: int = 2) -> Errors:
    """Return the error of two windows: couplers hang on their left crank and are tied to the right one."""
    c = redundant_constraints
    model = Model(c.END / c.STEPS, None, (0.0, -c.GRAVITY, 0.0))
    plant, joints, cranks, couplers = model.plant, [], [], []
    rod, middle, tip = (1e-4, 1.0 / 12.0, 1.0 / 12.0), [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]

    def hinge(name: str, parent: Any, place: list[float], angle: float, rate: float) -> Any:
        body = model.add_body(name, 1.0, rod, middle)
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
    **_free_bodies.cases({name: partial(free, scheme) for name, scheme in SCHEMES.items()}),
    "landing": standing,
    "slopes": sliding,
    "toppling": leaning,
    "redundant_constraints": four_bars,
}
