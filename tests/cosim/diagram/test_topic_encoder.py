"""Record batches equal the messages of single values byte for byte, also with texts that change between rows."""

from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import TopicEncoder, due_ticks, encode
from lapwing.kernels.row_packing import pack_row, row_unpacker
from lapwing.messages import Setpoint, header
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.messages.topics import EVENTS, SETPOINT, TOPICS, WALL_TIME, template_topic
from lapwing.services.autopilot.commander.commander_output import Status as Words
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.services.sensors.rangefinder import Rangefinder
from lapwing.services.sensors.sonar import Sonar
from tests.cosim.scalar_encoding import BUILDERS

SCENES = sorted((Path(__file__).parents[3] / "lapwing/scenes").glob("*.toml"))
FIRST, COUNT = 10_000, 16  # ticks
SATELLITES = "sensors.gps.constellation={}"
WORDS = (
    Words("mission", "", False, False, "", 0, 0, 65535, 1, False, (), (0.0, 0.0, 0.0), False, 0),
    Words(
        "hold",
        "",
        False,
        False,
        "the position is lost",
        2,
        7,
        1,
        3,
        True,
        ("not ready", "no GPS"),
        (1.5, -2.0, 0.5),
        False,
        0,
    ),
    Words("land", "", False, False, "", 1, 7, 0, 4, False, ("not ready",), (0.5, 0.25, 0.0), False, 2),
)


def random_value(example, random):
    """Return a tree like `example` with random numbers; integers are 0, 1 or 2."""
    if isinstance(example, tuple):
        items = [random_value(item, random) for item in example]
        return type(example)(*items) if hasattr(example, "_fields") else tuple(items)
    if isinstance(example, bool | int):
        return type(example)(random.integers(2 if isinstance(example, bool) else 3))
    return abs(random.standard_normal())


def known(config, services):
    """Return the constant contents of messages from the run configuration."""
    values = {name: service.parameters for name, service in config.services.items()}
    commander = next((p for s in services for p in s.blocks if p.name == "autopilot.commander"), None)
    phases, words = values["trajectory"].phases if "trajectory" in values else (), WORDS
    if commander is not None:
        for words in WORDS:
            commander.status_texts.number(words)
        for text in ("up", "along", "down"):
            commander.phases.number(text)
        phases, words = commander.phases.table, commander.status_texts.table
    if link := next((p for s in services for p in s.blocks if hasattr(p, "reports")), None):  # foreign firmware
        link.status_texts.table += WORDS
        phases, words = phases or ("",), link.status_texts.table
    encoding = values["plant"].encoding
    sensors = [instrument.sensor for instrument in values["sensors"]] if "sensors" in values else []
    return SimpleNamespace(
        vehicle=config.vehicle, cells=encoding.cells, capacity=encoding.capacity, bodies=encoding.bodies,
        sonar=next((sensor for sensor in sensors if isinstance(sensor, Sonar)), None), phases=phases, words=words,
        rangefinder=next((sensor for sensor in sensors if isinstance(sensor, Rangefinder)), None),
    )  # fmt: skip


def fitting(value, texts, random):
    """Return the value with a valid text number, and any combination of rejected sources."""
    if "rejected" in value._fields:
        return value._replace(rejected=int(random.integers(128)))
    return value._replace(phase=value.phase % len(texts)) if "phase" in value._fields else value


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_columnar_encoding_equals_scalar_encoding(path):
    vehicles = members(resolve(load(path)))
    for config in {vehicles[0].vehicle: vehicles[0], vehicles[-1].vehicle: vehicles[-1]}.values():
        check_every_topic(config, np.random.default_rng(5))


def check_every_topic(config, random):
    services = create_all(config)
    inputs = known(config, services)
    for encoder in (encoder for service in services for encoder in service.encoders):
        ticks = due_ticks(FIRST, FIRST + COUNT * encoder.period, encoder.period)
        port = config.port(encoder.port)
        trajectory = config.services.get("trajectory")
        texts = trajectory.parameters.phases if encoder.port == "trajectory" else inputs.phases
        values = [fitting(random_value(port.example, random), texts, random) for _ in ticks]
        rows = np.array([pack_row(value) for value in values])
        batches = list(encode(encoder, port, config, ticks, rows))
        result = {int(t): p.tobytes() for batch in batches for t, p in zip(batch.ticks, batch.payloads, strict=True)}
        assert sum(len(batch.ticks) for batch in batches) == len(result) == len(ticks)
        for tick, value in zip(ticks, values, strict=True):
            assert row_unpacker(port.example)(pack_row(value)) == value
            expected = BUILDERS[encoder.topic](inputs, int(tick) * config.interval_ns, value)
            assert result[tick] == expected.encode(), encoder.topic.name


def test_contact_forces_equal_scalar_encoding():
    check_every_topic(resolve(load("hover", ["rates.contact_forces=50"])), np.random.default_rng(5))


def test_satellite_details_equal_scalar_encoding():
    check_every_topic(resolve(load("quad_x", [SATELLITES])), np.random.default_rng(5))


def test_scenes_cover_all_topics():
    requested = load(
        "bridge", ["autopilot.accept_commands=true", "rates.contact_forces=50"]
    )  # publishes received airspeed, too
    clouds = load("bridge", ["sensors.lidar.preset=vlp16", "sensors.depth_camera.preset=ideal"])
    rings = load("bridge", ["sensors.lidar.preset=rplidar_a2"])
    satellites = load("quad_x", [SATELLITES])
    scenes = [*map(load, SCENES), requested, clouds, rings, satellites]
    spoken = {
        template_topic(topic) for scene in scenes for service in create_all(resolve(scene)) for topic in service.topics
    }
    assert spoken == set(TOPICS) - {WALL_TIME, EVENTS}


class Named(NamedTuple):
    """Number and index of its text."""

    number: float
    text: int


def test_batch_is_split_by_text_in_order_of_ticks():
    texts = ["climb", "on the way", "climb again"]
    config = SimpleNamespace(interval_ns=4_000_000)
    encoder = TopicEncoder(
        SETPOINT, "it", 1,
        lambda x, time_ns: {**stamp_columns(time_ns), "yaw": x.number},
        lambda text: Setpoint(header(0, "world"), phase=texts[text]),
        lambda x: [x.text],
    )  # fmt: skip
    rows = np.array([(0.5, 1), (1.5, 0), (2.5, 1), (3.5, 2), (4.5, 0)])
    batches = list(encode(encoder, Port("it", Named(0.0, 0)), config, np.arange(7, 12), rows))
    result = [
        (int(tick), Setpoint.decode(payload.tobytes()))
        for batch in batches
        for tick, payload in zip(batch.ticks, batch.payloads, strict=True)
    ]
    assert [(tick, m.phase, m.yaw) for tick, m in result] == [
        (8, "climb", 1.5), (11, "climb", 4.5), (7, "on the way", 0.5), (9, "on the way", 2.5), (10, "climb again", 3.5)
    ]  # fmt: skip
    assert all(m.header == header(4_000_000 * tick, "world") for tick, m in result)


@pytest.mark.parametrize(
    ("first", "stop", "period", "ticks"),
    [
        (0, 4, 1, [0, 1, 2, 3]),
        (1, 11, 5, [5, 10]),
        (5, 11, 5, [5, 10]),
        (6, 10, 5, []),
        (-3, 2, 1, [0, 1]),
        (3, 3, 1, []),
    ],
)
def test_ticks_at_which_message_is_due(first, stop, period, ticks):
    assert due_ticks(first, stop, period).tolist() == ticks


@pytest.mark.parametrize("stops", [[30], [1, 2, 7, 8, 9, 30], list(range(1, 31))])
def test_message_at_every_change_for_any_length_of_batches(stops):
    rows = np.zeros((30, 2))
    rows[7:9, 0], rows[20:, 1] = 1.0, 3.0  # changes at the ticks 7, 9 and 20
    encoder = TopicEncoder(SETPOINT, "status", 10, dict, dict, on_change=True)
    starts = [0, *stops[:-1]]
    ticks = [encoder.message_ticks(first, stop, lambda t: rows[t]) for first, stop in zip(starts, stops, strict=True)]
    assert np.concatenate(ticks).tolist() == [0, 7, 9, 10, 20]
