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
    assert [p.name for p in graph.listeners(mission)] == ["recorder", "router", "mavlink"]
    load_only = resolve(load("cooperative_load"))  # nobody steers: nothing for a ground station
    assert [p.name for p in graph.listeners(load_only)] == ["recorder", "router"]


@pytest.mark.parametrize("ending", ["png", "svg"])
def test_the_picture_shows_everybody(mission, tmp_path, ending):
    path = tmp_path / f"services.{ending}"
    graph.draw(mission, path)
    content = path.read_bytes()
    if ending == "svg":
        assert all(f"<!-- {name} -->".encode() in content for name in ("plant", "sensors", "recorder", "mavlink"))
    assert len(content) > 10_000
