"""Layouts for viewers name existing topics and fields."""

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from lapwing.messages.topics import TOPICS
from lapwing.messages.types import DEFINITIONS

FOLDER = Path("docs/layouts")
BY_KEY = {topic.key("drone1"): topic for topic in TOPICS}


def check(topic, fields):
    """Return True if a topic has a field by its dotted name; an element of a sequence as "name[0]"."""
    type_name = BY_KEY[topic].message.type_name
    for part in fields:
        name, index = re.fullmatch(r"(\w+)(\[\d\])?", part).groups()
        (field,) = [f for f in DEFINITIONS[type_name].fields if f.name == name]
        assert (field.length is not None) == (index is not None)
        type_name = field.base
    assert type_name not in DEFINITIONS  # a number or a text


def foxglove():
    """Return the layout for Foxglove."""
    return json.loads((FOLDER / "foxglove.json").read_text())


def test_foxglove_layout_uses_existing_fields():
    paths = [path["value"] for panel in foxglove()["configById"].values() for path in panel.get("paths", ())]
    assert len(paths) > 15
    for path in paths:
        topic, *fields = path.split(".")
        check(topic, fields)


def test_foxglove_shows_existing_topics():
    panels = foxglove()["configById"]
    shown = [
        *panels["3D!space"]["topics"],
        panels["RosOut!events"]["topicToRender"],
        panels["map!place"]["followTopic"],
    ]
    assert set(shown) <= set(BY_KEY)


def test_foxglove_places_every_panel_once():
    def panels(node):
        return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])

    layout = foxglove()
    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])


def test_plotjuggler_layout_uses_existing_fields():
    curves = [curve.attrib["name"] for curve in ET.parse(FOLDER / "plotjuggler.xml").iter("curve")]
    assert len(curves) > 30
    for curve in curves:
        _, vehicle, topic, *fields = curve.split("/")
        check(f"/{vehicle}/{topic}", fields)


def test_missing_layout_field_is_detected():
    with pytest.raises(ValueError):
        check("/drone1/ground_truth", ["pose", "yaw"])
