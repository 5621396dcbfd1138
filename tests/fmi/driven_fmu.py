"""Exported FMUs that tests step by hand, through FMPy."""

import ctypes
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import fmpy
import numpy as np
from fmpy import fmi2
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from recorded_ports import RecordedPorts

from lapwing.fmi.export.exported_part import ExportedPart
from lapwing.fmi.export.variables import variables_of

TYPES = {2: {"real": "Real", "integer": "Integer"}, 3: {"real": "Float64", "integer": "Int32"}}  # of the functions


class Slave:
    """One instance of an FMU of either version, with the functions that the tests use."""

    def __init__(self, path: Path, name: str = "a", **options: bool):
        self.model = fmpy.read_model_description(str(path))
        self.folder = fmpy.extract(str(path))
        self.is_3 = self.model.fmiVersion.startswith("3")
        self.fmu = (FMU3Slave if self.is_3 else FMU2Slave)(
            guid=self.model.guid, unzipDirectory=self.folder, instanceName=name,
            modelIdentifier=self.model.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.references = {v.name: v.valueReference for v in self.model.modelVariables}
        self.messages: list[tuple[int, str]] = []  # status and text of the FMU's log
        if self.is_3:
            self.fmu.instantiate(
                logMessage=lambda _, status, __, text: self.messages.append((status, text.decode())), **options
            )
        else:
            self._callbacks = fmi2.fmi2CallbackFunctions()
            ctypes.pointer(self._callbacks)[0] = fmi2.defaultCallbacks
            self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(
                lambda _, __, status, ___, text: self.messages.append((status, text.decode()))
            )
            self.fmu.instantiate(callbacks=self._callbacks)
        self.time = 0.0

    def begin(self, **start: float) -> None:
        for name, value in start.items():
            self.set(name, value)
        self.prepare()
        self.fmu.exitInitializationMode()

    def prepare(self) -> None:
        """Enter initialisation mode."""
        if not self.is_3:
            self.fmu.setupExperiment(startTime=self.time)
        self.fmu.enterInitializationMode(**({"startTime": self.time} if self.is_3 else {}))

    def get(self, name: str) -> float:
        return self.values("real", [name])[0]

    def set(self, name: str, value: float) -> None:
        self.set_values("real", {name: value})

    def values(self, kind: str, names: Sequence[str]) -> list[float]:
        """Return variables of one type: real, integer or boolean."""
        return getattr(self.fmu, f"get{self._type(kind)}")([self.references[name] for name in names])

    def set_values(self, kind: str, values: Mapping[str, float]) -> None:
        references = [self.references[name] for name in values]
        getattr(self.fmu, f"set{self._type(kind)}")(references, list(values.values()))

    def _type(self, kind: str) -> str:
        return TYPES[3 if self.is_3 else 2].get(kind, "Boolean")

    def step(self, size: float = 0.004) -> None:
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size

    def saved(self) -> bytes:
        get, serialise, free = (
            (self.fmu.getFMUState, self.fmu.serializeFMUState, self.fmu.freeFMUState)
            if self.is_3
            else (self.fmu.getFMUstate, self.fmu.serializeFMUstate, self.fmu.freeFMUstate)
        )
        state = get()
        data = serialise(state)
        free(state)
        return data

    def load(self, data: bytes) -> None:
        restore, put, free = (
            (self.fmu.deserializeFMUState, self.fmu.setFMUState, self.fmu.freeFMUState)
            if self.is_3
            else (self.fmu.deSerializeFMUstate, self.fmu.setFMUstate, self.fmu.freeFMUstate)
        )
        state = restore(data)
        put(state)
        free(state)

    def close(self) -> None:
        self.fmu.freeInstance()
        shutil.rmtree(self.folder)


def assert_recorded_outputs(path: Path, exported: ExportedPart, recorded: RecordedPorts) -> None:
    """Drive an FMU with recorded inputs, and compare all outputs at every tick bit for bit."""
    kinds = ("real", "integer", "boolean")
    inputs, outputs = (
        {kind: [v for v in variables_of(exported) if (v.causality, v.type) == (causality, kind)] for kind in kinds}
        for causality in ("input", "output")
    )
    assert any(outputs.values())
    a = Slave(path)

    def set_inputs(tick: int) -> None:
        """Set the samples that a tick reads; simulate_fmu would initialise with those of tick 1."""
        rows = np.concatenate([[], *(recorded.latest(p.port.name, tick - p.lag) for p in exported.inputs)])
        for kind, own in inputs.items():
            if own and tick >= max(p.lag for p in exported.inputs):
                a.set_values(kind, {v.name: (float if kind == "real" else int)(rows[v.offset]) for v in own})

    a.prepare()
    set_inputs(0)
    a.fmu.exitInitializationMode()
    for tick in range(recorded.ticks):
        if tick:
            set_inputs(tick)
            a.time = (tick - 1) * recorded.config.interval
            a.step(recorded.config.interval)
        for kind, own in outputs.items():
            if own:
                values = a.values(kind, [v.name for v in own])
                expected = [recorded.latest(exported.outputs[v.port].port.name, tick)[v.offset] for v in own]
                assert np.array_equal(np.array(values, float), expected, equal_nan=True), f"{kind} at tick {tick}"
    a.close()
