"""An FMU in its process, without a run."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.fmi.importer.host_process import HostProcess
from lapwing.fmi.importer.model import ImportedFmu
from lapwing.fmi.importer.schema import FmuTable
from lapwing.fmi.importer.service_config import Connection


class OpenedFmu:
    """An FMU that is stepped by hand."""

    def __init__(self, path: Path, outputs: Sequence[str], inputs: Sequence[str] = (), **table: Any):
        """Start the process; `table` are further keys of the scene's table."""
        fmu = ImportedFmu("a", FmuTable(fmu=str(path), timeout=300.0, **table))
        for name in outputs:
            fmu.export("outputs", name)
        config = fmu.with_exports(fmu.config({}, {"a": fmu}, {}))
        elements = [element for name in inputs for element in fmu.description.elements("inputs", name, "input")]
        config = config._replace(inputs=tuple(Connection("u", k, each, 1.0) for k, each in enumerate(elements)))
        self._request, self._reply = np.zeros(2 + len(config.inputs)), np.zeros(1 + len(config.outputs))
        self.time = 0.0
        self._host = HostProcess(config, self._request, self._reply)
        self._columns = [each.column for each in config.outputs]

    def initialise(self, *inputs: float) -> tuple[float, ...]:
        """Return the outputs at time 0."""
        return self._step(0.0, -1.0, inputs)

    def advance(self, end: float, *inputs: float) -> tuple[float, ...]:
        """Step to a time and return the outputs."""
        result = self._step(self.time, end - self.time, inputs)
        self.time = end
        return result

    def _step(self, time: float, step: float, inputs: Sequence[float]) -> tuple[float, ...]:
        self._request[:2] = time, step
        self._request[2 : 2 + len(inputs)] = inputs
        self._host.finish(0, 0)
        return tuple(value for _, value in sorted(zip(self._columns, self._reply[1:].tolist(), strict=True)))
