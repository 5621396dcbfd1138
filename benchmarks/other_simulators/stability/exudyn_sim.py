"""Exudyn: free bodies by an explicit Lie-group method."""

from typing import Any

import exudyn as exu
import numpy as np
from exudyn import utilities as build

from benchmarks.other_simulators.stability import _free_bodies


def settings(duration: float, steps: int, samples: int) -> Any:
    """Return the settings of a run with equal steps that keeps `samples` of them."""
    s: Any = exu.SimulationSettings()
    s.timeIntegration.endTime, s.timeIntegration.numberOfSteps = duration, steps
    s.timeIntegration.automaticStepSize = False
    s.timeIntegration.verboseMode = 0
    s.solutionSettings.writeSolutionToFile = False
    # with a margin, so that rounding delays no sample
    s.solutionSettings.sensorsWritePeriod = (duration - 0.25 * duration / steps) / samples
    return s


def free(inertia: Any, start: Any, duration: float, steps: int, samples: int) -> np.ndarray:
    """Return R_world_body and omega_body of a free body at equidistant times, shape (samples + 1, 12)."""
    w, x, y, z = start.attitude
    R = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    system = exu.SystemContainer().AddSystem()
    body = system.CreateRigidBody(
        inertia=build.RigidBodyInertia(mass=1.0, inertiaTensor=np.diag(inertia)),
        referenceRotationMatrix=R,
        initialAngularVelocity=list(R @ start.omega_body),
        nodeType=exu.NodeType.RotationRotationVector,
        returnDict=True,
    )["bodyNumber"]
    kinds = exu.OutputVariableType.RotationMatrix, exu.OutputVariableType.AngularVelocityLocal
    sensors = [
        system.AddSensor(build.SensorBody(bodyNumber=body, storeInternal=True, outputVariableType=kind))
        for kind in kinds
    ]
    system.Assemble()
    system.SolveDynamic(settings(duration, steps, samples), solverType=exu.DynamicSolverType.RK44, storeSolver=False)
    return np.hstack([np.array(system.GetSensorStoredData(sensor))[: samples + 1, 1:] for sensor in sensors])


CASES = _free_bodies.cases({"Exudyn RK44": free})
