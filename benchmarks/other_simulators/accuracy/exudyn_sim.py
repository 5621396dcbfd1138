"""Exudyn: explicit Lie-group integration of a rigid body in rotation vectors, fixed steps and adaptive."""

from collections.abc import Callable
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import utilities as build

from benchmarks.other_simulators.accuracy import matrix, outcome
from lapwing.studies.accuracy.problem import SolverMethod
from lapwing.studies.accuracy.systems import free_rigid_body, heavy_top

NAME, MODULE = "Exudyn", "exudyn"
HALVINGS = 15
TOLERANCES = tuple(10.0**-k for k in range(3, 14))
CASES = {"free_rigid_body": (free_rigid_body, 0.5), "heavy_top": (heavy_top, 0.02)}


def system(case: str) -> tuple[Any, int]:
    """Return (main system, body); the top's pivot is the body's origin, and its weight acts at the end of its arm."""
    module, _ = CASES[case]
    R = matrix(np.array(module.START.attitude))
    system = exu.SystemContainer().AddSystem()
    body = system.CreateRigidBody(
        inertia=build.RigidBodyInertia(mass=1.0, inertiaTensor=np.diag(module.INERTIA)),
        referenceRotationMatrix=R,
        initialAngularVelocity=list(R @ module.START.omega_body),
        nodeType=exu.NodeType.RotationRotationVector,
        returnDict=True,
    )
    if case == "heavy_top":
        weight = heavy_top.MASS * heavy_top.GRAVITY
        for place, force in ((heavy_top.ARM, -weight), (0.0, weight)):  # and the force at the pivot
            marker = build.MarkerBodyPosition(bodyNumber=body["bodyNumber"], localPosition=[place, 0, 0])
            load = build.LoadForceVector(markerNumber=system.AddMarker(marker), loadVector=[0, 0, force])
            system.AddLoad(load)
    system.Assemble()
    return system, body["bodyNumber"]


def methods(case: str) -> list[SolverMethod]:
    if case not in CASES:
        return []
    module, coarsest = CASES[case]

    def solver_method(
        name: str, order: int, unit: str, values: list[float], adapt: Callable[[Any, float], None]
    ) -> SolverMethod:
        main, body = system(case)

        def prepare(value: float) -> Callable[[], Any]:
            s = exu.SimulationSettings()
            s.timeIntegration.endTime = module.DURATION
            s.solutionSettings.writeSolutionToFile = False
            s.solutionSettings.sensorsWritePeriod = module.DURATION
            s.timeIntegration.verboseMode = 0
            adapt(s.timeIntegration, value)
            solver = getattr(exu.DynamicSolverType, name)

            def run() -> Any:
                main.SolveDynamic(s, solverType=solver, storeSolver=False)
                R = main.GetObjectOutputBody(body, exu.OutputVariableType.RotationMatrix, [0, 0, 0])
                omega = main.GetObjectOutputBody(body, exu.OutputVariableType.AngularVelocityLocal, [0, 0, 0])
                return np.array(R), np.array(omega)

            return run

        return SolverMethod(
            f"Exudyn {name}", order, unit, values, prepare, lambda _, end: outcome(module.DURATION, *end), lambda: None
        )

    def fixed(s: Any, step: float) -> None:
        s.numberOfSteps = round(module.DURATION / step)
        s.automaticStepSize = False

    def tolerance(s: Any, value: float) -> None:
        s.numberOfSteps = 100
        s.relativeTolerance = s.absoluteTolerance = value

    steps = [coarsest / 2**k for k in range(HALVINGS)]
    return [
        solver_method("RK44", 4, "s", steps, fixed),
        solver_method("RK67", 6, "s", steps, fixed),
        solver_method("DOPRI5", 5, "tol", list(TOLERANCES), tolerance),
    ]
