"""The Reference FMUs of the Modelica Association, imported and compared with the results that they carry.

LAPWING_REFERENCE_FMUS names a folder that has them as 2.0/NAME.fmu and 3.0/NAME.fmu. The reference results are made by
co-simulation. Model exchange is compared with exact solutions, since it does not have the error of the FMU's own step.
Clocks carries no results: they are those of the example `scs_synchronous` of the Reference FMUs, if the folder has its
`scs_synchronous_out.csv`, and those of the schedule that the description of the FMU documents.
"""

import csv
import io
import math
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


def simulated(path: Path, outputs: list[str], times: list[float], interface: str, **table) -> np.ndarray:
    fmu = OpenedFmu(path, outputs, interface=interface, **table)
    return np.array([fmu.initialise(), *(fmu.advance(t) for t in times[1:])])


@pytest.mark.parametrize(("version", "name"), CASES)
def test_co_simulation_has_reference_results(version: str, name: str) -> None:
    path = Path(FOLDER) / version / f"{name}.fmu"
    times, expected = reference(path)
    result = simulated(path, OUTPUTS[name], times, "co_simulation")
    assert np.array_equal(result, expected)


@pytest.mark.parametrize(("version", "name"), CASES)
def test_model_exchange_has_exact_solution(version: str, name: str) -> None:
    path = Path(FOLDER) / version / f"{name}.fmu"
    times, expected = reference(path)
    result = simulated(path, OUTPUTS[name], times, "model_exchange", accuracy=1e-10)
    if name == "Dahlquist":
        expected = np.exp(-np.array(times))[:, None]
    elif name == "StateSpace":
        expected = np.exp(np.array(times))[:, None] * [1.0, 2.0, 3.0]
    elif name == "VanDerPol":
        from scipy.integrate import solve_ivp

        def rate(_: float, x: np.ndarray) -> tuple[float, float]:
            return x[1], (1.0 - x[0] ** 2) * x[1] - x[0]

        expected = solve_ivp(rate, (0.0, times[-1]), [2.0, 0.0], "DOP853", times, rtol=1e-12, atol=1e-12).y.T
    elif name == "BouncingBall":
        expected = np.array([bouncing_ball(t) for t in times])
    assert result == pytest.approx(expected, rel=1e-7, abs=1e-7)


def bouncing_ball(t: float) -> tuple[float, float]:
    """Return height and velocity of the model's ball: 0.7 of the speed after a bounce, at rest below 0.1 m/s."""
    g, begin, v = 9.81, -math.sqrt(2.0 / 9.81), math.sqrt(2.0 * 9.81)
    while t >= begin + 2.0 * v / g:
        begin, v = begin + 2.0 * v / g, 0.7 * v
        if v < 0.1:
            return 0.0, 0.0
    s = t - begin
    return v * s - 0.5 * g * s * s, v - g * s


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
@pytest.mark.parametrize("interface", ["co_simulation", "model_exchange"])
def test_feedthrough_returns_every_numeric_type(version: str, interface: str) -> None:
    path = Path(FOLDER) / version / "Feedthrough.fmu"
    types = OLD_TYPES if version == "2.0" else list(FEEDTHROUGH)
    inputs, outputs = [f"{name}_input" for name in types], [f"{name}_output" for name in types]
    fmu = OpenedFmu(path, outputs, inputs, interface=interface)
    lowest, highest = zip(*(FEEDTHROUGH[name] for name in types), strict=True)
    assert fmu.initialise(*lowest) == lowest
    assert fmu.advance(0.1, *lowest) == lowest
    assert fmu.advance(0.2, *highest) == highest


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("interface", ["co_simulation", "model_exchange"])
def test_feedthrough_has_reference_results(version: str, interface: str) -> None:
    """The results are those without inputs; ports hold no texts and bytes."""
    path = Path(FOLDER) / version / "Feedthrough.fmu"
    outputs = [f"{name}_output" for name in (OLD_TYPES if version == "2.0" else FEEDTHROUGH)]
    rows = reference_rows(path)
    numbers = {"true": 1.0, "false": 0.0}
    expected = [[numbers[x] if (x := row[name]) in numbers else float(x) for name in outputs] for row in rows]
    times = [float(row["time"]) for row in rows]
    assert simulated(path, outputs, times, interface).tolist() == expected


def test_fmu_that_ends_simulation_is_named() -> None:
    from lapwing.services.fmu.host_process import HostError

    for version in ("2.0", "3.0"):
        fmu = OpenedFmu(Path(FOLDER) / version / "Stair.fmu", ["counter"], interface="co_simulation")
        fmu.initialise()
        counts = [fmu.advance(0.2 * k)[0] for k in range(1, 46)]
        assert counts[-1] == 10.0
        with pytest.raises(HostError, match=r"requested the end of the simulation \(t = 9 s\)"):
            fmu.advance(9.2)


def test_clocks_has_reference_results() -> None:
    """One clock ticks every second, one at 0, 1, 8 and 9 s, and a countdown that the first starts at 4 s."""
    outputs = ["inClock1Ticks", "inClock2Ticks", "inClock3Ticks", "totalInClockTicks"]
    fmu = OpenedFmu(Path(FOLDER) / "3.0" / "Clocks.fmu", [*outputs, "result2", "output3"], ["inClock2", "input2"])
    triggered = [float(k in (0, 1, 8, 9)) for k in range(10)]
    result = [fmu.initialise(triggered[0], 1.0), *(fmu.advance(k, triggered[k], k + 1.0) for k in range(1, 10))]
    counts = [(k + 1, sum(triggered[: k + 1]), float(k >= 4)) for k in range(10)]
    assert [row[:4] for row in result] == [(*row, sum(row)) for row in counts]
    assert [row[4] for row in result] == [1, 3, 3, 3, 3, 3, 3, 3, 12, 22]  # sum of input2 at the triggered ticks
    assert [row[5] for row in result] == [1000.0 * (k >= 4) for k in range(10)]
    example = Path(FOLDER) / "scs_synchronous_out.csv"
    if example.exists():
        rows = np.loadtxt(example, delimiter=",", skiprows=1)
        assert rows.tolist() == [[k, *row[:4]] for k, row in enumerate(result)]
