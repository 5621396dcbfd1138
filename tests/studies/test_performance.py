"""The performance card: figures of the models beside the published ones."""

import math
from pathlib import Path

import pytest

from dynamics.vehicles import performance
from dynamics.vehicles.airframe import load_airframe
from studies.performance import card, write_json

ROOT = Path(__file__).parents[2]
VEHICLE = ROOT / "scenes/vehicles/delivery_drone.toml"


def test_a_scene_and_its_vehicle_give_the_same_card():
    assert card(VEHICLE) == card(ROOT / "scenes/hover.toml")


def test_units_of_the_card():
    rows = {row.name: row for row in card(VEHICLE)}
    drone = load_airframe(VEHICLE)
    assert rows["hover time"].computed == pytest.approx(performance.hover_time(drone) / 60.0)
    assert rows["maximum tilt"].computed == pytest.approx(math.degrees(performance.maximum_tilt(drone)))
    assert rows["hover time"].published == pytest.approx(19.3)
    assert rows["maximum tilt"].published == pytest.approx(58.9, abs=0.05)


def test_where_nothing_is_chosen_the_models_come_near_the_paper():
    rows = {row.name: row for row in card(VEHICLE)}
    for name in ("hover time", "maximum payload", "ceiling", "maximum tilt"):
        assert rows[name].computed == pytest.approx(rows[name].published, rel=0.06), name


def test_every_published_figure_says_why_it_may_differ():
    assert all(row.reason for row in card(VEHICLE) if row.published is not None)


def test_json(tmp_path):
    write_json(tmp_path / "card.json", card(VEHICLE))
    assert '"hover time"' in (tmp_path / "card.json").read_text()


def test_what_is_neither_scene_nor_vehicle_is_refused(tmp_path):
    (tmp_path / "x.toml").write_text("[nonsense]\n")
    with pytest.raises(ValueError, match="nonsense"):
        card(tmp_path / "x.toml")
    with pytest.raises(ValueError, match=r"none\.toml"):
        card(tmp_path / "none.toml")
