"""The Reference FMUs of the Modelica Association, imported and compared with the results that they carry.

LAPWING_REFERENCE_FMUS names a folder that has them as 2.0/NAME.fmu and 3.0/NAME.fmu. The reference results are made by
co-simulation. Model exchange is compared with exact solutions, since it does not have the error of the FMU's own step.
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

from lapwing.dynamics.config_error import ConfigError

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


def reference(path: Path) -> tuple[list[float], np.ndarray]:
    """Return times and values of the results in an FMU, columns of arrays one after the other."""
    with zipfile.ZipFile(path) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith("_out.csv"))
        rows = list(csv.reader(io.StringIO(archive.read(name).decode())))[1:]
    return [float(row[0]) for row in rows], np.array(
        [[float(x) for cell in row[1:] for x in cell.split()] for row in rows]
    )


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


@pytest.mark.parametrize("interface", ["co_simulation", "model_exchange"])
def test_feedthrough_returns_every_numeric_type(interface: str) -> None:
    path = Path(FOLDER) / "3.0" / "Feedthrough.fmu"
    types = ["Float32_continuous", "Float64_continuous", *(f"{u}Int{n}" for u in ("", "U") for n in (8, 16, 32, 64))]
    types += ["Boolean", "Enumeration"]
    inputs, outputs = [f"{name}_input" for name in types], [f"{name}_output" for name in types]
    fmu = OpenedFmu(path, outputs, inputs, interface=interface)
    lowest = (-0.5, -1e300, -128, -32768, -(2**31), -(2**63), 0, 0, 0, 0, 0, 1)
    highest = (1.5, 1e300, 127, 32767, 2**31 - 1, 2**53, 255, 65535, 2**32 - 1, 2**53, 1, 2)
    assert fmu.initialise(*lowest) == lowest
    assert fmu.advance(0.1, *lowest) == lowest
    assert fmu.advance(0.2, *highest) == highest


def test_fmu_that_ends_simulation_is_named() -> None:
    from lapwing.services.fmu.host_process import HostError

    for version in ("2.0", "3.0"):
        fmu = OpenedFmu(Path(FOLDER) / version / "Stair.fmu", ["counter"], interface="co_simulation")
        fmu.initialise()
        counts = [fmu.advance(0.2 * k)[0] for k in range(1, 46)]
        assert counts[-1] == 10.0
        with pytest.raises(HostError, match=r"asked to end the simulation \(t = 9 s\)"):
            fmu.advance(9.2)


def test_clocks_is_rejected_by_name() -> None:
    with pytest.raises(ConfigError, match="for scheduled execution only"):
        OpenedFmu(Path(FOLDER) / "3.0" / "Clocks.fmu", ["inClock1Ticks"])
