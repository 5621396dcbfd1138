"""Error of the solver alone: repeated parts of a flight under its recorded commands."""

from types import SimpleNamespace

import numpy as np
import pytest

from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.services.common.ports import ImuReading, TrueState
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy import open_loop
from lapwing.studies.accuracy.open_loop import fly_parts, inputs_of_plant
from lapwing.studies.accuracy.sensitivity import first_signal, with_start_shifted
from lapwing.studies.accuracy.state_errors import TOPICS, differences
from lapwing.studies.simulate import fly_with_ports


def setup_of(step, *overrides, scene="delivery_mission"):
    return resolve(load(scene, ["run.duration=7", f"solver.step={step}", "solver.accuracy=1e-7", *overrides]))


@pytest.fixture(scope="module")
def run():
    return fly_with_ports(setup_of(0.001), TOPICS)


def errors(run, finer):
    flights, graph = run
    parts = fly_parts(graph, finer, TOPICS, lambda tick: None)
    return [q for part in parts for q in differences(flights[0], part.flights[0], part.spans)]


def test_parts_with_same_solver_repeat_flight(run):
    assert {quantity.error for quantity in errors(run, run[1].setup)} == {0.0}


def test_spans_cover_each_tick_once(run):
    flights, graph = run
    one, other = fly_parts(graph, graph.setup, TOPICS, lambda tick: None)
    times = flights[0].truth.times
    counts = [sum(a <= t < b for a, b in [*one.spans, *other.spans]) for t in times.tolist()]
    assert counts == [1] * len(times)


def test_error_falls_with_fourth_power_of_step(run):
    """RK4 against steps of 1/16 ms: its error at 1 ms is 16 times the one at 0.5 ms."""
    finer = setup_of(0.0000625)
    coarse = {q.name: q.error for q in errors(run, finer)}
    half = {q.name: q.error for q in errors(fly_with_ports(setup_of(0.0005), TOPICS), finer)}
    assert coarse["position"] / half["position"] == pytest.approx(16.0, rel=0.3)
    assert coarse["position"] < 1e-7


def test_plant_reads_commands_of_autopilot(run):
    assert inputs_of_plant(run[1]) == ["actuators", "status"]


@pytest.mark.parametrize("scene", ["delivery_mission", "fleet"])
def test_shifted_start_differs_in_every_number(scene):
    setup = resolve(load(scene, []))

    def motions(run):
        plant = run.services["plant"].parameters
        return (
            [each.parameters.start.vehicle.motion for each in plant.given]
            if scene == "fleet"
            else [plant.start.vehicle.motion]
        )

    for own, shifted in zip(motions(setup), motions(with_start_shifted(setup, 1e-8)), strict=True):
        a, b = (np.concatenate([np.ravel(part) for part in motion]) for motion in (own, shifted))
        np.testing.assert_allclose(b - a, 1e-8 * (1.0 + np.abs(a)), rtol=1e-6)


def test_restart_includes_outputs_read_a_tick_later(monkeypatch):
    """Vehicles of a fleet act on each other by their states of the previous tick, as in `carried_load`."""
    port = Port("load", 0.0)

    def plant(value):
        part = Block("plant", None, value, (InputPort("load", 1), InputPort("actuators", 1)), (port,))
        graph = BlockDiagram.__new__(BlockDiagram)
        graph.ports, graph._rows = {"load": port}, {"load": np.full((8, 1), value)}
        return open_loop._Plant(graph, Service("plant", [part], []))

    states = []
    monkeypatch.setattr(open_loop, "write", lambda cell, value: states.append((cell, value)))
    monkeypatch.setattr(open_loop, "read", lambda cell: cell)
    own, recorded = plant(1.0), plant(2.0)
    open_loop._restart(own, recorded, 5)
    assert states == [(1.0, 2.0)]
    assert own.graph.ring("load")[:, 0].tolist() == [1.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0]


def test_first_signal_is_earliest_beyond_limit():
    def graph(imu, truth):
        like = {"truth": TrueState(), "imu": ImuReading()}
        rows = {"truth": np.zeros((5, 38)), "imu": np.zeros((3, 9))}
        rows["imu"][:, 1], rows["truth"][:, 0] = imu, truth
        ports = [Port("truth", like["truth"], 1), Port("imu", like["imu"], 2)]
        services = [
            SimpleNamespace(name=name, parts=[SimpleNamespace(outputs=[port])])
            for name, port in zip(("plant", "sensors"), ports, strict=True)
        ]
        return SimpleNamespace(
            services=services, setup=SimpleNamespace(interval=0.01), history=lambda name, period: rows[name]
        )

    a, b = graph([0.0, 1e-9, 2e-3], 1.0), graph([0.0, 0.0, 1e-3], 0.0)
    assert first_signal(a, b, 1e-4) == pytest.approx(("imu.omega_body", 1e-3 / 1.001, 0.04))
    assert first_signal(a, a, 1e-4) is None
