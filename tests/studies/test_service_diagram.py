"""The picture of the services, from the set-up alone."""

import pytest

from lapwing.services.scene_resolver import load, resolve
from lapwing.studies import service_diagram


@pytest.fixture(scope="module")
def mission():
    return resolve(load("delivery_mission"))


def test_what_is_handed_over(mission):
    found = service_diagram.handed(mission)
    assert found["plant", "sensors"] == ["truth"]
    assert found["autopilot", "plant"] == ["actuators*", "status*"]
    assert "imu" in found["sensors", "autopilot"]
    assert found["trajectory", "autopilot"] == ["trajectory"]


def test_who_listens(mission):
    assert [p.name for p in service_diagram.listeners(mission)] == ["recorder", "router", "mavlink", "foxglove", "ros2"]
    load_only = resolve(load("cooperative_load"))  # nobody steers: nothing for a ground station
    assert [p.name for p in service_diagram.listeners(load_only)] == ["recorder", "router", "foxglove", "ros2"]


def test_every_topic_has_an_arrow_of_its_own_and_the_link_leads_to_a_ground_station(mission):
    found = service_diagram.arrows(mission)
    told = [arrow.text for arrow in found]
    handed = [text for texts in service_diagram.handed(mission).values() for text in texts]
    beside = ["every recorded topic", *["every topic"] * 3, "telemetry", "commands", "MAVLink 2"]
    assert sorted(told) == sorted([*handed, *beside])
    assert len({(arrow.start, arrow.end) for arrow in found}) == len(found)  # none lies on another
    link = found[told.index("MAVLink 2")]
    assert link.both_ways
    assert "MAVLink 2" not in [arrow.text for arrow in service_diagram.arrows(resolve(load("cooperative_load")))]


def test_arrows_begin_and_end_at_the_edges_of_their_services(mission):
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
def test_the_picture_shows_everybody(mission, tmp_path, ending):
    path = tmp_path / f"services.{ending}"
    service_diagram.draw(mission, path)
    content = path.read_bytes()
    if ending == "svg":
        shown = ("plant", "sensors", "recorder", "mavlink", "ground station", "imu")
        assert all(f"<!-- {name} -->".encode() in content for name in shown)
    assert len(content) > 10_000
