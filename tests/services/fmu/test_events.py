import math
from pathlib import Path

import pytest
from event_fmu import write_event_fmu
from opened_fmu import OpenedFmu

pytest.importorskip("fmpy")

from lapwing.services.fmu.host_process import HostError

G = 9.81
KINDS = [(2, "ModelExchange"), (3, "ModelExchange"), (3, "CoSimulation")]


@pytest.fixture(scope="module")
def balls(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[int, str], Path]:
    folder = tmp_path_factory.mktemp("ball")
    paths = {kind: folder / f"ball{k}.fmu" for k, kind in enumerate(KINDS)}
    for (version, kind), path in paths.items():
        write_event_fmu(path, version, kind)
    return paths


def ball(path: Path, version: int, **table) -> OpenedFmu:
    inputs = ["u0", "u1"] if version == 2 else ["u"]
    return OpenedFmu(path, ["h", "v", "count", "bounces"], inputs, **table)


def height(t: float, e: float) -> tuple[float, float, int]:
    """Return height, velocity and number of bounces of a ball that falls from 1 m."""
    begin, v, bounces = math.sqrt(2.0 / G), math.sqrt(2.0 * G), 0
    if t < begin:
        return 1.0 - 0.5 * G * t * t, -G * t, 0
    while True:
        v, bounces = v * e, bounces + 1
        if t < begin + 2.0 * v / G:
            s = t - begin
            return v * s - 0.5 * G * s * s, v - G * s, bounces
        begin += 2.0 * v / G


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("step", [0.004, 0.3])
def test_state_events_are_located_exactly(balls: dict, kind: tuple[int, str], step: float) -> None:
    fmu = ball(balls[kind], kind[0], start={"e": 0.8})
    fmu.initialise(-4.0, -5.81)
    for k in range(1, round(1.8 / step) + 1):
        h, v, _, bounces = fmu.advance(k * step, -4.0, -5.81)
        expected = height(k * step, 0.8)
        assert (h, v) == pytest.approx(expected[:2], abs=1e-8)
        assert bounces == expected[2]
    assert bounces >= 2


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("step", [0.004, 0.03, 0.2])
def test_time_events_occur_at_their_time(balls: dict, kind: tuple[int, str], step: float) -> None:
    fmu = ball(balls[kind], kind[0])
    fmu.initialise(0.0, 0.0)
    for k in range(1, round(0.6 / step) + 1):
        count = fmu.advance(k * step, 0.0, 0.0)[2]
        assert count == math.floor(k * step / 0.05 + 1e-9)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_changed_inputs_act_from_begin_of_step(balls: dict, kind: tuple[int, str]) -> None:
    fmu = ball(balls[kind], kind[0])
    fmu.initialise(0.0, 0.0)
    assert fmu.advance(0.1, 0.0, 0.0)[:2] == (1.0, 0.0)
    h, v, _, _ = fmu.advance(0.2, 1.0, 2.0)
    assert (h, v) == pytest.approx((1.015, 0.3), abs=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("integrator", ["euler", "rk4", "rkmk54", "rk8_renormalised"])
def test_every_integrator_meets_accuracy(balls: dict, integrator: str) -> None:
    fmu = ball(balls[3, "ModelExchange"], 3, integrator=integrator, accuracy=1e-6)
    fmu.initialise(-9.81, 0.0)
    h, v, _, _ = fmu.advance(0.4, -9.81, 0.0)
    assert (h, v) == pytest.approx((1.0 - 0.5 * G * 0.16, -G * 0.4), abs=2e-3 if integrator == "euler" else 1e-9)


def test_array_elements_are_set_and_read_separately(balls: dict) -> None:
    path = balls[3, "ModelExchange"]
    fmu = OpenedFmu(path, ["y[1]", "y[0]"], ["u[1]"], start={"u": [2.0, 3.0]})
    fmu.initialise(1.0)
    assert fmu.advance(0.5, 1.0) == pytest.approx((1.5, 1.375))  # v, h at an acceleration of 2 + 1


@pytest.mark.parametrize("version", [2, 3])
def test_failing_derivatives_are_error(balls: dict, version: int) -> None:
    fmu = ball(balls[version, "ModelExchange"], version, start={"fault": 1})
    fmu.initialise(0.0, 0.0)
    fmu.advance(0.2, 0.0, 0.0)
    with pytest.raises(HostError, match="getDerivatives failed with status 3"):
        fmu.advance(0.4, 0.0, 0.0)


def test_number_beyond_type_is_error(balls: dict) -> None:
    fmu = OpenedFmu(balls[3, "ModelExchange"], ["h"], ["small"])
    fmu.initialise(-128.0)
    fmu.advance(0.1, 127.0)
    with pytest.raises(HostError, match="small cannot be set to 128"):
        fmu.advance(0.2, 128.0)
