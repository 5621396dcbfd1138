"""Parts of a scene as FMUs that FMPy couples.

    python -m benchmarks.fmu_coupling [--scene SCENE] [RATES...]

Flies the scene with exported FMUs under a Gauss-Seidel and a Jacobi master, and compares them with the same couplings
in Lapwing. Noise is removed as by `lapwing accuracy`.
"""

import tempfile
from pathlib import Path
from typing import Annotated, Any

import fmpy
import numpy as np
import typer
from fmpy.fmi3 import FMU3Slave

from benchmarks._command import command_line
from lapwing.cosim.config.run_config import RunConfig
from lapwing.fmi.export.fmu import export_fmu
from lapwing.messages.topics import TRUTH
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy.error_budget import noise_overrides, rate_overrides
from lapwing.studies.simulate import fly

RATES = [250, 500, 1000]  # [Hz]
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
        self.has_feedthrough = any(output.dependencies != [] for output in model.outputs)
        self.inputs: list[tuple[Part, str, list[int], list[int]]] = []

    def connect(self, others: list["Part"]) -> None:
        """Find the outputs of other parts that have the names of the inputs, grouped by part and type."""
        groups: dict[tuple[int, str], list[str]] = {}
        for name, v in self.variables.items():
            if v.causality == "input":
                variables = [{} if other is self else other.variables for other in others]
                source = next(k for k, o in enumerate(variables) if name in o and o[name].causality == "output")
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

    def row(self, port: str) -> list[float]:
        """Return the current columns of an output port."""
        own = [v for v in self.variables.values() if v.name.startswith(f"{port}.") and v.causality == "output"]
        values: dict[int, Any] = {}
        for kind in {v.type for v in own}:
            references = [v.valueReference for v in own if v.type == kind]
            values |= zip(references, getattr(self.fmu, f"get{kind}")(references), strict=True)
        return [float(values[v.valueReference]) for v in own]


def coupled(config: RunConfig, paths: dict[str, Path], jacobi: bool, ticks: int) -> np.ndarray:
    """Return the columns of `truth` at each tick, shape (ticks, n); the first three are the position [m].

    The FMUs step in the order of `paths`, the plant first. In a Gauss-Seidel coupling, those without direct
    feedthrough take their inputs before the first step, as in the run.
    """
    parts = [Part(name, path) for name, path in paths.items()]
    for part in parts:
        part.connect(parts)
    plant = parts[0]
    for part in parts:
        part.fmu.enterInitializationMode()
    for part in parts[1:]:  # in the order of execution; the plant reads the tick before
        part.set(part.values())
    for part in parts:
        part.fmu.exitInitializationMode()
    rows = [plant.row("truth")]
    for k in range(ticks - 1):
        early = {part.name: part.values() for part in parts if jacobi or not part.has_feedthrough}
        for part in parts:
            part.set(early[part.name] if part.name in early else part.values())
            part.fmu.doStep(k * config.interval, config.interval)
        rows.append(plant.row("truth"))
    for part in parts:
        part.fmu.freeInstance()
    return np.array(rows)


def lapwing_positions(scene: str, settings: list[str], coupling: str) -> np.ndarray:
    return np.array(fly(load(scene, [*settings, f"communication.coupling={coupling}"]), (TRUTH,)).truth.position)


def distance(one: np.ndarray, other: np.ndarray) -> str:
    """Return the 90th percentile and the maximum of the distance between two flights; one may have a higher rate."""
    every = max(1, round((len(other) - 1) / (len(one) - 1)))
    n = min(len(one), len(other[::every]))
    d = np.linalg.norm(one[:n] - other[::every][:n], axis=1)
    return f"{np.quantile(d, 0.9):.1e} ({d.max():.1e})" if d.max() else "same bits"


def main(scene: str = "delivery_mission", rates: Annotated[list[int], typer.Argument()] = RATES) -> None:
    loaded = load(scene)

    def settings(rate: int) -> list[str]:
        step = 1.0 / (FINEST * max(rates))  # equal for all rates
        return [*noise_overrides(loaded), *rate_overrides(loaded, rate), f"solver.step={step!r}"]

    finest = lapwing_positions(scene, settings(FINEST * max(rates)), "gauss_seidel")
    print("| rate | FMPy Gauss-Seidel to `lapwing run` | FMPy Jacobi to `lapwing run` with Jacobi |", end="")
    print(" Gauss-Seidel to finest | Jacobi to Gauss-Seidel |\n|---|---|---|---|---|")
    for rate in rates:
        own = lapwing_positions(scene, settings(rate), "gauss_seidel")
        parallel = lapwing_positions(scene, settings(rate), "jacobi")
        config = resolve(load(scene, settings(rate)))
        with tempfile.TemporaryDirectory() as name:
            paths = {part: Path(name) / f"{part}.fmu" for part in config.order}
            for part, path in paths.items():
                export_fmu(config, part, path)
            sequential, jacobi = (coupled(config, paths, way, len(own))[:, :3] for way in (False, True))
        cells = (
            distance(sequential, own),
            distance(jacobi, parallel),
            distance(sequential, finest),
            distance(jacobi, own),
        )
        print(f"| {rate} Hz | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    command_line(main)
