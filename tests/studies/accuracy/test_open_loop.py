"""Error of the solver alone: repeated parts of a flight under its recorded commands."""

from types import SimpleNamespace

import numpy as np
import pytest

from lapwing.cosim.diagram.block_diagram import BlockDiagram, ExternalBlock, Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.services.common.ports import ImuReading, TrueState
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy import open_loop
from lapwing.studies.accuracy.open_loop import fly_parts, inputs_of_plant, starts_of_parts
from lapwing.studies.accuracy.sensitivity import first_signal, with_start_shifted
from lapwing.studies.accuracy.state_errors import TOPICS, differences
from lapwing.studies.simulate import fly_with_ports


def config_of(step, *overrides, scene="delivery_mission"):
    return resolve(load(scene, ["run.duration=7", f"solver.step={step}", "solver.accuracy=1e-7", *overrides]))


@pytest.fixture(scope="module")
def run():
    return fly_with_ports(config_of(0.001), TOPICS)


def errors(run, finer):
    flights, diagram = run
    parts = fly_parts(diagram, starts_of_parts(diagram), finer, TOPICS)
    return [q for part in parts for q in differences(flights[0], part.flights[0], part.spans)]


def test_parts_with_same_solver_repeat_flight(run):
    assert {quantity.error for quantity in errors(run, run[1].config)} == {0.0}


def test_more_updates_of_the_plant_change_only_what_it_holds(run):
    """Each command acts as long as before: without held quantities the parts are equal, except for round-off."""
    finer = config_of(0.000125)
    faster = config_of(0.000125, "communication.rate=2000")._replace(last_tick=8 * run[1].tick - 1)
    starts = starts_of_parts(run[1])
    series = [fly_parts(run[1], starts, config, TOPICS) for config in (finer, faster)]
    held = [q for a, b in zip(*series, strict=True) for q in differences(a.flights[0], b.flights[0], a.spans)]
    assert {"position", "attitude", "velocity", "body rates", "rotor speed"} <= {q.name for q in held}
    assert max(q.error for q in held) < 1e-5


def test_spans_cover_each_tick_once(run):
    flights, diagram = run
    one, other = fly_parts(diagram, starts_of_parts(diagram), diagram.config, TOPICS)
    times = flights[0].truth.times
    counts = [sum(a <= t < b for a, b in [*one.spans, *other.spans]) for t in times.tolist()]
    assert counts == [1] * len(times)


def test_error_falls_with_fourth_power_of_step(run):
    """RK4 against steps of 1/16 ms: its error at 1 ms is 16 times the one at 0.5 ms."""
    finer = config_of(0.0000625)
    coarse = {q.name: q.error for q in errors(run, finer)}
    half = {q.name: q.error for q in errors(fly_with_ports(config_of(0.0005), TOPICS), finer)}
    assert coarse["position"] / half["position"] == pytest.approx(16.0, rel=0.3)
    assert coarse["position"] < 1e-7


def test_plant_reads_commands_of_autopilot(run):
    assert inputs_of_plant(run[1]) == ["actuators", "status"]


@pytest.mark.parametrize("scene", ["delivery_mission", "fleet"])
def test_shifted_start_differs_in_every_number(scene):
    config = resolve(load(scene, []))

    def motions(run):
        plant = run.services["plant"].parameters
        return (
            [each.parameters.start.vehicle.motion for each in plant.given]
            if scene == "fleet"
            else [plant.start.vehicle.motion]
        )

    for own, shifted in zip(motions(config), motions(with_start_shifted(config, 1e-8)), strict=True):
        a, b = (np.concatenate([np.ravel(part) for part in motion]) for motion in (own, shifted))
        np.testing.assert_allclose(b - a, 1e-8 * (1.0 + np.abs(a)), rtol=1e-6)


def test_restart_includes_outputs_read_a_tick_later(monkeypatch):
    """Vehicles of a fleet act on each other by their states of the previous tick, as in `carried_load`."""
    port = Port("load", 0.0)

    def plant(value):
        part = Block("plant", None, value, (InputPort("load", 1), InputPort("actuators", 1)), (port,))
        diagram = BlockDiagram.__new__(BlockDiagram)
        diagram.ports, diagram._rows = {"load": port}, {"load": np.full((8, 1), value)}
        return open_loop._Plant(diagram, Service("plant", [part], []))

    states = []
    monkeypatch.setattr(open_loop, "write", lambda cell, value: states.append((cell, value)))
    monkeypatch.setattr(open_loop, "read", lambda cell: cell)
    own, recorded = plant(1.0), plant(2.0)
    open_loop._restart(own, open_loop._start(recorded, 5), 1)
    assert states == [(1.0, 2.0)]
    assert own.diagram.ring("load")[:, 0].tolist() == [1.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0]


def test_more_updates_read_each_command_as_long_as_the_recorded_plant(monkeypatch):
    """A plant reads the command of the tick before; four updates of a tick read the same one."""
    ports = [Port("truth", 0.0, 1), Port("actuators", 0.0, 1)]

    def config(interval, last_tick):
        by_name = {port.name: port for port in ports}
        return SimpleNamespace(ports=by_name, interval=interval, last_tick=last_tick, ended_by=None)

    def create(config, name):
        part = ExternalBlock("plant", ports[0])
        part.inputs = (InputPort("actuators", 1),)
        return Service("plant", [part], [])

    monkeypatch.setattr(open_loop, "create", create)
    autopilot = Service("autopilot", [ExternalBlock("autopilot", ports[1])], [])
    flight = BlockDiagram(config(0.004, 4), [create(None, "plant"), autopilot], 1, {"actuators"})
    flight.tick = 5
    flight.put_rows("actuators", np.arange(5), np.array([[10.0], [11.0], [12.0], [13.0], [14.0]]))
    diagram = open_loop._plant(flight, config(0.001, 19)).diagram
    assert [float(diagram.row("actuators", tick - 1)[0]) for tick in range(1, 20)] == (
        [10.0] * 4 + [11.0] * 4 + [12.0] * 4 + [13.0] * 4 + [14.0] * 3
    )


def test_first_signal_is_earliest_beyond_limit():
    def diagram(imu, truth):
        example = {"truth": TrueState(), "imu": ImuReading()}
        rows = {"truth": np.zeros((5, 38)), "imu": np.zeros((3, 9))}
        rows["imu"][:, 1], rows["truth"][:, 0] = imu, truth
        ports = [Port("truth", example["truth"], 1), Port("imu", example["imu"], 2)]
        services = [
            SimpleNamespace(name=name, blocks=[SimpleNamespace(outputs=[port])])
            for name, port in zip(("plant", "sensors"), ports, strict=True)
        ]
        return SimpleNamespace(
            services=services, config=SimpleNamespace(interval=0.01), history=lambda name, period: rows[name]
        )

    a, b = diagram([0.0, 1e-9, 2e-3], 1.0), diagram([0.0, 0.0, 1e-3], 0.0)
    assert first_signal(a, b, 1e-4) == pytest.approx(("imu.omega_body", 1e-3 / 1.001, 0.04))
    assert first_signal(a, a, 1e-4) is None
