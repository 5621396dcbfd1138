"""Several vehicles in a scene: each flies bit for bit as alone, in one diagram and in one for each service."""

import re

import pytest

from lapwing.cosim.config.serialise import first_difference, from_json, to_json
from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram, Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.multi_vehicle import member, members, merge_services
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.cosim.run_errors import DivergedError
from lapwing.cosim.scene import SceneError
from lapwing.kernels import on_compile
from lapwing.kernels.cell import Cell
from lapwing.messages.topics import CLOCK, IMU, TF, custom_sensor, of_vehicle, topic_named
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import from_resolved, load, parse, reseed, resolve
from tests.cosim.blocks.signals import Signals
from tests.cosim.memory_log import fly
from tests.cosim.small_graph import graph_of
from tests.cosim.test_agreement import fly_apart
from tests.scenes import head, phase

pytestmark = pytest.mark.long

WIND = ["effects.random_wind_force.sigma=1.0", "effects.random_wind_force.allow_body_drag=true"]
SHORT = ["run.duration=1.0", *WIND]
COMMON = head(1.0) + phase("climb", 1.0, "trajectory", z=1.0)


def fleet_of(n, tmp_path):
    """Return a scene of n equal vehicles, 2 m apart."""
    entries = [f'[[vehicle]]\nairframe = "delivery_drone"\ninitial_position = [0.0, {2.0 * i}]\n' for i in range(n)]
    return parse(tmp_path / "many.toml", COMMON + "".join(entries))


@pytest.fixture(scope="module")
def config():
    return resolve(load("fleet", SHORT))


@pytest.fixture(scope="module")
def flown(config):
    return fly(config)


@pytest.mark.parametrize("vehicle", ["left", "right", "scout"])
def test_vehicle_in_fleet_publishes_as_alone(vehicle, config, flown):
    alone = fly(member(config, vehicle))
    own = {name: topic for name, topic in alone.topics.items() if topic not in (CLOCK, TF)}
    assert {name for name in flown.topics if name.startswith(f"{vehicle}/")} == {f"{vehicle}/{name}" for name in own}
    for name in own:
        assert flown.payloads(f"{vehicle}/{name}") == alone.payloads(name), name
    assert alone.payloads("clock") == flown.payloads("clock")
    transforms = [payload for _, payload in flown.payloads("tf")]
    assert [payload for _, payload in alone.payloads("tf")] == transforms[config.vehicles.index(vehicle) :: 3]


def test_random_numbers_differ_by_vehicle(flown):
    """Compare two equal vehicles under the same law, which differ in position and wind only."""
    left, right = (flown.view(f"{name}/ground_truth").wind for name in ("left", "right"))
    assert (left != right).any()


def test_vehicle_and_path_start_at_initial_position(flown):
    for name, (x, y) in {"left": (0.0, 3.0), "right": (0.0, -3.0), "scout": (-3.0, 0.0)}.items():
        assert flown.view(f"{name}/ground_truth").position[0, :2] == pytest.approx((x, y))
        assert flown.view(f"{name}/setpoint").position[0, :2] == pytest.approx((x, y))
    assert flown.view("scout/estimate").position[0, :2] == pytest.approx((-3.0, 0.0), abs=0.1)


def test_separate_diagrams_have_equal_results(config, flown):
    apart = fly_apart(config, None)
    assert apart.topics.keys() == flown.topics.keys()
    assert apart.digest == flown.digest


def test_additional_vehicle_of_type_compiles_no_kernel(tmp_path):
    two, three = (resolve(fleet_of(n, tmp_path)) for n in (2, 3))
    BlockDiagram(two, create_all(two), KEPT_TICKS).advance(1)
    compiled = []
    on_compile(compiled.append)
    BlockDiagram(three, create_all(three), KEPT_TICKS).advance(1)
    assert compiled == []


class Waking:
    """Python block that notes its ticks."""

    name, outputs = "asked", ()

    def __init__(self, vehicle):
        self.vehicle, self.ticks = vehicle, []

    def bind(self, diagram):
        pass

    def on_tick(self, tick):
        self.ticks.append(tick)
        return NEVER


def test_python_blocks_wake_per_vehicle_until_last_vehicle_ends():
    requested = Waking("a"), Waking("b")
    signals = {"a": Signals(5, 7), "b": Signals(2, 9)}
    compiled = [Block(name, p, Cell(0.0), vehicle=name) for name, p in signals.items()]
    diagram = graph_of(*compiled, *requested)
    diagram.advance(100)
    assert (diagram.ended, diagram.tick) == (True, 10)
    assert [part.ticks for part in requested] == [[0, 5], [0, 2]]


def test_fleet_config_survives_text_and_another_seed(config):
    scene = load("fleet", SHORT)
    for vehicle, result in zip(scene.vehicles, members(config), strict=True):
        assert first_difference(result, resolve(vehicle)) is None
    assert first_difference(from_json(to_json(config)), config) is None
    assert first_difference(resolve(from_resolved(config.resolved, "fleet")), config) is None
    assert first_difference(reseed(config, 7), resolve(load("fleet", [*SHORT, "run.seed=7"]))) is None


def test_invalid_state_error_names_vehicle(config):
    part = Block("plant", None, None, failure=lambda tick: DivergedError(f"not finite at tick {tick}"))
    joined = merge_services("plant", [(member(config, "right"), Service("plant", [part], []))])
    error = joined.blocks[0].failure(3)
    assert (type(error), str(error)) == (DivergedError, "right: not finite at tick 3")


def test_names_and_system_ids_are_numbered(tmp_path):
    scene = fleet_of(3, tmp_path)
    assert [vehicle.lookup("vehicle.name") for vehicle in scene.vehicles] == ["drone1", "drone2", "drone3"]
    assert [vehicle.lookup("mavlink.system_id") for vehicle in scene.vehicles] == [1, 2, 3]


def test_topics_have_prefix_of_vehicle():
    assert of_vehicle(IMU, "left") is topic_named("left/imu")
    assert (topic_named("left/imu").key(), of_vehicle(TF, "left")) == ("/left/imu", TF)
    assert topic_named("left/custom_sensor/x") is of_vehicle(custom_sensor("x"), "left")
    with pytest.raises(ValueError, match=r"^no topic \{vehicle\}/imuu$"):
        topic_named("left/imuu")


WRONG = {
    "vehicle.7.name=x": "override vehicle.7.name=x: no such vehicle; expected vehicle.N.name, N from 0 to 2",
    "vehicle.left.initial_position=[0,0]": (
        "override vehicle.left.initial_position=[0,0]: no such vehicle; "
        "expected vehicle.N.initial_position, N from 0 to 2"
    ),
    "vehicle.left.airframe.mass.total=3": (
        "override vehicle.left.airframe.mass.total=3: no such vehicle; expected vehicle.N.airframe.mass.total, N from"
    ),
    "vehicle.name=x": "override vehicle.name=x: no such vehicle; expected vehicle.N.name, N from 0 to 2",
    "vehicle.1.run.seed=3": "override vehicle.1.run.seed: all vehicles share this table; expected a table [run]",
    "vehicle.1.name=left": "override vehicle.1.name: left is already used by vehicle.0; expected another value",
    "vehicle.1.mavlink.system_id=1": "override vehicle.1.mavlink.system_id: 1 is already used by vehicle.0",
    "vehicle.2.autopilot.gains=x": "override vehicle.2.autopilot.gains: unknown gain set 'x'",
    "vehicle.0.nam=3": "override vehicle.0.nam: unknown key 'nam'; did you mean name?",
    "vehicle.0.airframe.mass.total=-3": (
        "override vehicle.0.airframe.mass.total: expected a number above 0 [kg], got -3"
    ),
    "autopilot.gains=x": "override autopilot.gains: unknown gain set 'x'",
}


@pytest.mark.parametrize("override", WRONG)
def test_fault_names_vehicle_and_key(override):
    with pytest.raises(SceneError, match=f"^{re.escape(WRONG[override])}"):
        load("fleet", [override])


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (
            "[vehicle.communication]\nrate = 100\n",
            "many.toml:18: vehicle.0.communication: all vehicles share this table",
        ),
        ("[vehicle.effects.gravty]\n", "many.toml:18: vehicle.0.effects.gravty: unknown effect 'gravty'"),
        ("[[vehicle]]\nairframe = 3\n", "many.toml:19: vehicle.1.airframe: expected a text, got 3"),
        ("[[vehicle]]\n" * 50, "vehicle: 51 vehicles; expected 1 to 50"),
    ],
)
def test_fault_names_line(entry, message, tmp_path):
    with pytest.raises(SceneError) as error:
        parse(tmp_path / "many.toml", COMMON + '[[vehicle]]\nairframe = "delivery_drone"\n' + entry)
    assert message in str(error.value)


def test_function_for_single_vehicle_rejects_fleet():
    with pytest.raises(SceneError, match=r"vehicle: there are 3; expected a scene with one vehicle"):
        load("fleet").tables("effects")
