"""Drake: continuous MultibodyPlant with error-controlled Runge-Kutta integrators."""

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BallRpyJoint, QuaternionFloatingJoint, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from benchmarks.other_simulators.accuracy import matrix, outcome
from benchmarks.other_simulators.accuracy.mujoco_sim import ACROSS, AXIAL, rotor_speeds
from lapwing.studies.accuracy.problem import SolverMethod
from lapwing.studies.accuracy.systems import free_rigid_body, gyrostat, heavy_top

NAME, MODULE = "Drake", "drake"
SCHEMES = {"runge_kutta3": 3, "runge_kutta5": 5}
TOLERANCES = tuple(10.0**-k for k in range(1, 14))
MODULES = {"free_rigid_body": free_rigid_body, "heavy_top": heavy_top, "gyrostat_steady": gyrostat}


def inertia(mass: float, place: list[float], about_place: tuple) -> SpatialInertia:
    """Return the inertia from principal moments about the body's origin; `place` is the centre of mass [m]."""
    return SpatialInertia(mass, place, UnitInertia(*(i / mass for i in about_place)))


def plant_of(case: str) -> tuple[MultibodyPlant, Any, list[Any]]:
    """Return (plant, body, rotor joints)."""
    plant = MultibodyPlant(0.0)
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -heavy_top.GRAVITY if case == "heavy_top" else 0.0])
    rotors = []
    if case == "free_rigid_body":
        body = plant.AddRigidBody("body", inertia(1.0, [0, 0, 0], free_rigid_body.INERTIA))
        plant.AddJoint(QuaternionFloatingJoint("free", plant.world_frame(), body.body_frame()))
    elif case == "heavy_top":
        body = plant.AddRigidBody("body", inertia(heavy_top.MASS, [heavy_top.ARM, 0, 0], heavy_top.INERTIA))
        plant.AddJoint(BallRpyJoint("pivot", plant.world_frame(), body.body_frame()))
    else:
        platform = tuple(i - 2 * ACROSS for i in gyrostat.STEADY.inertia)
        body = plant.AddRigidBody("body", inertia(1.0, [0, 0, 0], platform))
        plant.AddJoint(QuaternionFloatingJoint("free", plant.world_frame(), body.body_frame()))
        for i in range(3):
            moments = tuple(AXIAL if i == j else ACROSS for j in range(3))
            rotor = plant.AddRigidBody(f"rotor{i}", inertia(1.0, [0, 0, 0], moments))
            joint = RevoluteJoint(f"axis{i}", body.body_frame(), rotor.body_frame(), np.eye(3)[i])
            rotors.append(plant.AddJoint(joint))
    plant.Finalize()
    return plant, body, rotors


def methods(case: str) -> list[SolverMethod]:
    module = MODULES[case]
    R_start = matrix(np.array(module.START.attitude))
    omega_start = np.array(module.START.omega_body)

    def solver_method(scheme: str) -> SolverMethod:
        plant, body, rotors = plant_of(case)
        simulator = Simulator(plant)
        context = simulator.get_mutable_context()

        def restart() -> None:
            context.SetTime(0.0)
            if case == "heavy_top":
                joint = plant.GetJointByName("pivot")
                joint.set_angles(context, RollPitchYaw(RotationMatrix(R_start)).vector())
                joint.set_angular_velocity(context, R_start @ omega_start)
            else:
                joint = plant.GetJointByName("free")
                joint.SetQuaternion(context, Quaternion(np.array(module.START.attitude)))
                joint.set_angular_velocity(context, R_start @ omega_start)
            for rotor, speed in zip(rotors, rotor_speeds(), strict=False):
                rotor.set_angle(context, 0.0)
                rotor.set_angular_rate(context, speed)

        def prepare(tolerance: float) -> Callable[[], Any]:
            config = SimulatorConfig(
                integration_scheme=scheme,
                accuracy=tolerance,
                max_step_size=0.01 * module.DURATION,
                use_error_control=True,
            )

            def run() -> Any:
                restart()
                ApplySimulatorConfig(config, simulator)
                simulator.Initialize()
                simulator.AdvanceTo(module.DURATION)
                pose: RigidTransform = plant.EvalBodyPoseInWorld(context, body)
                R = pose.rotation().matrix()
                return R, R.T @ plant.EvalBodySpatialVelocityInWorld(context, body).rotational()

            return run

        def read(tolerance: float, end: Any) -> Any:
            return outcome(module.DURATION, *end)

        return SolverMethod(f"Drake {scheme}", SCHEMES[scheme], "tol", TOLERANCES, prepare, read, lambda: None)

    return [solver_method(scheme) for scheme in SCHEMES]
