"""Diagram of the services from a run configuration."""

import pytest

from lapwing.services.scene_resolver import load, resolve
from lapwing.views import service_diagram


@pytest.fixture(scope="module")
def mission():
    return resolve(load("delivery_mission"))


def test_diagram_shows_ports(mission):
    result = service_diagram.ports_by_pair(mission)
    assert result["plant", "sensors"] == ["truth"]
    assert result["autopilot", "plant"] == ["actuators*", "status*"]
    assert "imu" in result["sensors", "autopilot"]
    assert result["trajectory", "autopilot"] == ["trajectory"]


def test_diagram_shows_listeners(mission):
    assert [p.name for p in service_diagram.listeners(mission)] == ["recorder", "router", "mavlink", "foxglove", "ros2"]
    load_only = resolve(load("cooperative_load"))  # no autopilot: no ground station
    assert [p.name for p in service_diagram.listeners(load_only)] == ["recorder", "router", "foxglove", "ros2"]


def test_every_topic_has_its_arrow(mission):
    result = service_diagram.arrows(mission)
    reported = [arrow.text for arrow in result]
    handed = [text for texts in service_diagram.ports_by_pair(mission).values() for text in texts]
    beside = ["every recorded topic", *["every topic"] * 3, "telemetry", "commands", "MAVLink 2"]
    assert sorted(reported) == sorted([*handed, *beside])
    assert len({(arrow.start, arrow.end) for arrow in result}) == len(result)  # no overlap
    link = result[reported.index("MAVLink 2")]
    assert link.both_ways
    assert "MAVLink 2" not in [arrow.text for arrow in service_diagram.arrows(resolve(load("cooperative_load")))]


def test_arrows_begin_and_end_at_edges_of_their_services(mission):
    at = service_diagram.places(mission)
    for arrow in service_diagram.arrows(mission):
        if arrow.colour == service_diagram.FLOWN:
            for x, y in (arrow.start, arrow.end):
                sides = [
                    max(abs(x - p) / service_diagram.HALF[0], abs(y - q) / service_diagram.HALF[1])
                    for p, q in at.values()
                ]
                assert min(sides) == pytest.approx(1.0)


@pytest.mark.parametrize("ending", ["png", "svg"])
def test_architecture_picture_shows_every_service(mission, tmp_path, ending):
    path = tmp_path / f"services.{ending}"
    service_diagram.draw(mission, path)
    content = path.read_bytes()
    if ending == "svg":
        shown = ("plant", "sensors", "recorder", "mavlink", "ground station", "imu")
        assert all(f"<!-- {name} -->".encode() in content for name in shown)
    assert len(content) > 10_000
