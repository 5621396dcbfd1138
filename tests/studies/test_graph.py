"""The picture of the services, from the set-up alone."""

import pytest

from services.table import load, resolve
from studies import graph


@pytest.fixture(scope="module")
def mission():
    return resolve(load("delivery_mission"))


def test_what_is_handed_over(mission):
    found = graph.handed(mission)
    assert found["plant", "sensors"] == ["truth"]
    assert found["autopilot", "plant"] == ["actuators*", "status*"]
    assert "imu" in found["sensors", "autopilot"]
    assert found["trajectory", "autopilot"] == ["trajectory"]


def test_who_listens(mission):
    assert [p.name for p in graph.listeners(mission)] == ["recorder", "router", "mavlink", "foxglove", "ros2"]
    load_only = resolve(load("cooperative_load"))  # nobody steers: nothing for a ground station
    assert [p.name for p in graph.listeners(load_only)] == ["recorder", "router", "foxglove", "ros2"]


def test_every_topic_has_an_arrow_of_its_own_and_the_link_leads_to_a_ground_station(mission):
    found = graph.arrows(mission)
    told = [arrow.text for arrow in found]
    handed = [text for texts in graph.handed(mission).values() for text in texts]
    beside = ["every recorded topic", *["every topic"] * 3, "telemetry", "commands", "MAVLink 2"]
    assert sorted(told) == sorted([*handed, *beside])
    assert len({(arrow.start, arrow.end) for arrow in found}) == len(found)  # none lies on another
    link = found[told.index("MAVLink 2")]
    assert link.both_ways
    assert "MAVLink 2" not in [arrow.text for arrow in graph.arrows(resolve(load("cooperative_load")))]


def test_arrows_begin_and_end_at_the_edges_of_their_services(mission):
    at = graph.places(mission)
    for arrow in graph.arrows(mission):
        if arrow.colour == graph.FLOWN:
            for x, y in (arrow.start, arrow.end):
                sides = [max(abs(x - p) / graph.HALF[0], abs(y - q) / graph.HALF[1]) for p, q in at.values()]
                assert min(sides) == pytest.approx(1.0)


@pytest.mark.parametrize("ending", ["png", "svg"])
def test_the_picture_shows_everybody(mission, tmp_path, ending):
    path = tmp_path / f"services.{ending}"
    graph.draw(mission, path)
    content = path.read_bytes()
    if ending == "svg":
        shown = ("plant", "sensors", "recorder", "mavlink", "ground station", "imu")
        assert all(f"<!-- {name} -->".encode() in content for name in shown)
    assert len(content) > 10_000
