"""Exudyn: explicit Lie-group integration of a rigid body in rotation vectors, with fixed steps and adaptive."""

from collections.abc import Callable
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import utilities as build

from benchmarks._simulators import _cases, matrix, outcome
from lapwing.studies.accuracy.problem import SolverMethod
from lapwing.studies.accuracy.systems import free_rigid_body, heavy_top

NAME, MODULE = "Exudyn", "exudyn"
HALVINGS = 15
TOLERANCES = [10.0**-k for k in range(3, 14)]
PROBLEMS = {"free_rigid_body": (free_rigid_body, 0.5), "heavy_top": (heavy_top, 0.02)}  # coarsest step [s]


def system_of(inertia: Any, start: Any) -> tuple[Any, int]:
    """Return (system, body) of a free body at its start, not yet assembled."""
    system, R = exu.SystemContainer().AddSystem(), matrix(np.array(start.attitude))
    body = system.CreateRigidBody(
        inertia=build.RigidBodyInertia(mass=1.0, inertiaTensor=np.diag(inertia)),
        referenceRotationMatrix=R,
        initialAngularVelocity=list(R @ start.omega_body),
        nodeType=exu.NodeType.RotationRotationVector,
        returnDict=True,
    )
    return system, body["bodyNumber"]


def settings(duration: float, period: float) -> Any:
    """Return the settings of a run that writes no file; `period` [s] of its sensors."""
    s: Any = exu.SimulationSettings()
    s.timeIntegration.endTime, s.timeIntegration.verboseMode = duration, 0
    s.solutionSettings.writeSolutionToFile, s.solutionSettings.sensorsWritePeriod = False, period
    return s


def with_equal_steps(s: Any, steps: int) -> None:
    s.numberOfSteps, s.automaticStepSize = steps, False


def with_tolerance(s: Any, tolerance: float) -> None:
    s.numberOfSteps = 100
    s.relativeTolerance = s.absoluteTolerance = tolerance


def problem_of(case: str) -> tuple[Any, int]:
    """Return (system, body); the top's pivot is the body's origin, and its weight acts at the end of its arm."""
    module, _ = PROBLEMS[case]
    system, body = system_of(module.INERTIA, module.START)
    if case == "heavy_top":
        weight = heavy_top.MASS * heavy_top.GRAVITY
        for place, force in ((heavy_top.ARM, -weight), (0.0, weight)):  # and the force at the pivot
            marker = system.AddMarker(build.MarkerBodyPosition(bodyNumber=body, localPosition=[place, 0, 0]))
            system.AddLoad(build.LoadForceVector(markerNumber=marker, loadVector=[0, 0, force]))
    system.Assemble()
    return system, body


def methods(case: str) -> list[SolverMethod]:
    if case not in PROBLEMS:
        return []
    module, coarsest = PROBLEMS[case]

    def solver_method(name: str, order: int, unit: str, values: list[float]) -> SolverMethod:
        system, body = problem_of(case)

        def prepare(value: float) -> Callable[[], Any]:
            s, solver = settings(module.DURATION, module.DURATION), getattr(exu.DynamicSolverType, name)
            if unit == "s":
                with_equal_steps(s.timeIntegration, round(module.DURATION / value))
            else:
                with_tolerance(s.timeIntegration, value)

            def run() -> Any:
                system.SolveDynamic(s, solverType=solver, storeSolver=False)
                R = system.GetObjectOutputBody(body, exu.OutputVariableType.RotationMatrix, [0, 0, 0])
                omega = system.GetObjectOutputBody(body, exu.OutputVariableType.AngularVelocityLocal, [0, 0, 0])
                return np.array(R), np.array(omega)

            return run

        return SolverMethod(
            f"Exudyn {name}", order, unit, values, prepare, lambda _, end: outcome(module.DURATION, *end), lambda: None
        )

    steps = [coarsest / 2**k for k in range(HALVINGS)]
    return [
        solver_method("RK44", 4, "s", steps),
        solver_method("RK67", 6, "s", steps),
        solver_method("DOPRI5", 5, "tol", TOLERANCES),
    ]


def free(inertia: Any, start: Any, duration: float, steps: int, samples: int) -> np.ndarray:
    """Return R_world_body and omega_body of a free body at equidistant times, shape (samples + 1, 12)."""
    system, body = system_of(inertia, start)
    kinds = exu.OutputVariableType.RotationMatrix, exu.OutputVariableType.AngularVelocityLocal
    sensors = [
        system.AddSensor(build.SensorBody(bodyNumber=body, storeInternal=True, outputVariableType=kind))
        for kind in kinds
    ]
    system.Assemble()
    s = settings(duration, (duration - 0.25 * duration / steps) / samples)  # a margin: rounding delays no sample
    with_equal_steps(s.timeIntegration, steps)
    system.SolveDynamic(s, solverType=exu.DynamicSolverType.RK44, storeSolver=False)
    return np.hstack([np.array(system.GetSensorStoredData(sensor))[: samples + 1, 1:] for sensor in sensors])


CASES = _cases.free_body_cases({"Exudyn RK44": free})
