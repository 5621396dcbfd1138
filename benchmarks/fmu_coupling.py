"""Parts of a scene as FMUs that FMPy couples: `python -m benchmarks.fmu_coupling [SCENE [RATE ...]]`.

Flies the scene with exported FMUs under a Gauss-Seidel and a Jacobi master, and compares them with the same couplings
in Lapwing. Noise is removed as by `lapwing accuracy`.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave

from lapwing.cosim.config.run_config import RunConfig
from lapwing.fmi.fmu import export_fmu
from lapwing.messages.topics import TRUTH
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy.error_budget import noise_overrides, rate_overrides
from lapwing.studies.simulate import fly

FINEST = 2  # factor from the highest rate


class Part:
    """FMU with its connections."""

    def __init__(self, name: str, path: Path):
        self.name, model = name, fmpy.read_model_description(str(path))
        self.fmu = FMU3Slave(
            guid=model.guid, unzipDirectory=fmpy.extract(str(path)), instanceName=name,
            modelIdentifier=model.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.fmu.instantiate()
        self.variables = {v.name: v for v in model.modelVariables}
        self.inputs: list[tuple[Part, str, list[int], list[int]]] = []

    def connect(self, others: list["Part"]) -> None:
        """Find the outputs of other parts that have the names of the inputs, grouped by part and type."""
        groups: dict[tuple[int, str], list[str]] = {}
        for name, v in self.variables.items():
            if v.causality == "input":
                source = next(
                    k for k, o in enumerate(others) if name in o.variables and o is not self and _is_output(o, name)
                )
                groups.setdefault((source, v.type), []).append(name)
        for (k, kind), names in groups.items():
            read = [others[k].variables[name].valueReference for name in names]
            self.inputs.append((others[k], kind, read, [self.variables[name].valueReference for name in names]))

    def values(self) -> list[Any]:
        """Return the current values of all inputs at their sources."""
        return [getattr(part.fmu, f"get{kind}")(read) for part, kind, read, _ in self.inputs]

    def set(self, values: list[Any]) -> None:
        for (_, kind, _, write), row in zip(self.inputs, values, strict=True):
            getattr(self.fmu, f"set{kind}")(write, row)

    def outputs(self, references: list[int]) -> list[float]:
        return self.fmu.getFloat64(references)


def _is_output(part: Part, name: str) -> bool:
    return part.variables[name].causality == "output"


def coupled(setup: RunConfig, paths: dict[str, Path], jacobi: bool, ticks: int) -> np.ndarray:
    """Return the position at each tick, shape (ticks, 3) [m]."""
    parts = [Part(name, path) for name, path in paths.items()]
    for part in parts:
        part.connect(parts)
    plant = next(part for part in parts if part.name == "plant")
    references = [plant.variables[f"truth.position_world[{i}]"].valueReference for i in range(3)]
    for part in parts:  # in the order of execution, so that outputs of tick 0 exist before they are read
        part.fmu.enterInitializationMode()
        if part is not plant:
            part.set(part.values())
        part.fmu.exitInitializationMode()
    rows = [plant.outputs(references)]
    for k in range(ticks - 1):
        options = [part.values() for part in parts] if jacobi else []
        for i, part in enumerate(parts):
            part.set(options[i] if jacobi else part.values())
            part.fmu.doStep(k * setup.interval, setup.interval)
        rows.append(plant.outputs(references))
    for part in parts:
        part.fmu.freeInstance()
    return np.array(rows)


def flown(scene: str, settings: list[str], coupling: str) -> np.ndarray:
    return np.array(fly(load(scene, [*settings, f"communication.coupling={coupling}"]), (TRUTH,)).truth.position)


def distance(one: np.ndarray, other: np.ndarray) -> str:
    """Return the 90th percentile and the maximum of the distance between two flights; one may have a higher rate."""
    every = max(1, round((len(other) - 1) / (len(one) - 1)))
    n = min(len(one), len(other[::every]))
    d = np.linalg.norm(one[:n] - other[::every][:n], axis=1)
    return f"{np.quantile(d, 0.9):.1e} ({d.max():.1e})" if d.max() else "same bits"


def main(scene: str, *rates: str) -> None:
    loaded = load(scene)
    chosen = [int(rate) for rate in rates] or [250, 500, 1000]

    def settings(rate: int) -> list[str]:
        step = 1.0 / (FINEST * max(chosen))  # equal for all rates
        return [*noise_overrides(loaded), *rate_overrides(loaded, rate), f"solver.step={step!r}"]

    finest = flown(scene, settings(FINEST * max(chosen)), "gauss_seidel")
    print("| rate | FMPy Gauss-Seidel to `lapwing run` | FMPy Jacobi to `lapwing run` with Jacobi |", end="")
    print(" Gauss-Seidel to finest | Jacobi to Gauss-Seidel |\n|---|---|---|---|---|")
    for rate in chosen:
        own = flown(scene, settings(rate), "gauss_seidel")
        parallel = flown(scene, settings(rate), "jacobi")
        setup = resolve(load(scene, settings(rate)))
        with tempfile.TemporaryDirectory() as name:
            paths = {part: Path(name) / f"{part}.fmu" for part in setup.order}
            for part, path in paths.items():
                export_fmu(setup, part, path)
            sequential = coupled(setup, paths, False, len(own))
            jacobi = coupled(setup, paths, True, len(own))
        cells = (
            distance(sequential, own),
            distance(jacobi, parallel),
            distance(sequential, finest),
            distance(jacobi, own),
        )
        print(f"| {rate} Hz | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(*(sys.argv[1:] or ["delivery_mission"]))
