"""The Reference FMUs of the Modelica Association, imported and compared with the results that they carry.

LAPWING_REFERENCE_FMUS names a folder that has them as 2.0/NAME.fmu and 3.0/NAME.fmu. The reference results are made by
co-simulation.
"""

import csv
import io
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest
from opened_fmu import OpenedFmu

pytest.importorskip("fmpy")

FOLDER = os.environ.get("LAPWING_REFERENCE_FMUS", "")
pytestmark = pytest.mark.skipif(not FOLDER, reason="LAPWING_REFERENCE_FMUS names no folder of Reference FMUs")
OUTPUTS = {
    "BouncingBall": ["h", "v"],
    "Dahlquist": ["x"],
    "Resource": ["y"],
    "Stair": ["counter"],
    "StateSpace": ["y"],
    "VanDerPol": ["x0", "x1"],
}
CASES = [(version, name) for version in ("2.0", "3.0") for name in OUTPUTS if (version, name) != ("2.0", "StateSpace")]


def reference_rows(path: Path) -> list[dict[str, str]]:
    """Return the results in an FMU, as texts by the name of the column."""
    with zipfile.ZipFile(path) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith("_out.csv"))
        return list(csv.DictReader(io.StringIO(archive.read(name).decode())))


def reference(path: Path) -> tuple[list[float], np.ndarray]:
    """Return times and values of the results in an FMU, columns of arrays one after the other."""
    times, *columns = zip(*(row.values() for row in reference_rows(path)), strict=True)
    rows = [[float(x) for cell in row for x in cell.split()] for row in zip(*columns, strict=True)]
    return [float(time) for time in times], np.array(rows)


def simulated(path: Path, outputs: list[str], times: list[float]) -> np.ndarray:
    fmu = OpenedFmu(path, outputs)
    return np.array([fmu.initialise(), *(fmu.advance(t) for t in times[1:])])


@pytest.mark.parametrize(("version", "name"), CASES)
def test_co_simulation_has_reference_results(version: str, name: str) -> None:
    path = Path(FOLDER) / version / f"{name}.fmu"
    times, expected = reference(path)
    result = simulated(path, OUTPUTS[name], times)
    assert np.array_equal(result, expected)


FEEDTHROUGH = {  # lowest and highest value of the type
    "Float32_continuous": (-0.5, 1.5),
    "Float32_discrete": (-0.25, 2.5),
    "Float64_continuous": (-1e300, 1e300),
    "Float64_discrete": (-1e-300, 0.1),
    **{f"Int{n}": (-(2.0 ** (n - 1)), 2.0 ** (n - 1) - 1.0) for n in (8, 16, 32)},
    **{f"UInt{n}": (0.0, 2.0**n - 1.0) for n in (8, 16, 32)},
    "Int64": (-(2.0**63), 2.0**53),
    "UInt64": (0.0, 2.0**53),
    "Boolean": (0.0, 1.0),
    "Enumeration": (1.0, 2.0),
}
OLD_TYPES = ["Float64_continuous", "Float64_discrete", "Int32", "Boolean", "Enumeration"]  # those of FMI 2.0


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_feedthrough_returns_every_numeric_type(version: str) -> None:
    path = Path(FOLDER) / version / "Feedthrough.fmu"
    types = OLD_TYPES if version == "2.0" else list(FEEDTHROUGH)
    inputs, outputs = [f"{name}_input" for name in types], [f"{name}_output" for name in types]
    fmu = OpenedFmu(path, outputs, inputs)
    lowest, highest = zip(*(FEEDTHROUGH[name] for name in types), strict=True)
    assert fmu.initialise(*lowest) == lowest
    assert fmu.advance(0.1, *lowest) == lowest
    assert fmu.advance(0.2, *highest) == highest


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_feedthrough_has_reference_results(version: str) -> None:
    """The results are those without inputs; ports hold no texts and bytes."""
    path = Path(FOLDER) / version / "Feedthrough.fmu"
    outputs = [f"{name}_output" for name in (OLD_TYPES if version == "2.0" else FEEDTHROUGH)]
    rows = reference_rows(path)
    numbers = {"true": 1.0, "false": 0.0}
    expected = [[numbers[x] if (x := row[name]) in numbers else float(x) for name in outputs] for row in rows]
    times = [float(row["time"]) for row in rows]
    assert simulated(path, outputs, times).tolist() == expected


def test_fmu_that_ends_simulation_is_named() -> None:
    from lapwing.fmi.importer.host_process import HostError

    for version in ("2.0", "3.0"):
        fmu = OpenedFmu(Path(FOLDER) / version / "Stair.fmu", ["counter"])
        fmu.initialise()
        counts = [fmu.advance(0.2 * k)[0] for k in range(1, 46)]
        assert counts[-1] == 10.0
        with pytest.raises(HostError, match=r"requested the end of the simulation \(t = 9 s\)"):
            fmu.advance(9.2)
