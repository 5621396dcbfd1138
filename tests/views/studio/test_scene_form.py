"""Forms of scenes: fields from the schema, overrides from texts, command line and Python."""

import re

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.cosim.scene.toml_text import toml
from lapwing.file_schemas.json_schema import scene_schema
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.services.scene_resolver import load
from lapwing.views.studio.form_fields import additions, form, starting_values
from lapwing.views.studio.scene_forms import Change, changes, command_line, python


@pytest.fixture(scope="module")
def schema():
    return scene_schema()


def fields(scene, schema):
    return {field.key: field for group in form(load(scene), schema) for field in group.all_fields()}


def test_field_has_unit_range_help_and_value(schema):
    duration = fields("hover", schema)["run.duration"]
    assert (duration.text, duration.kind, duration.unit) == ("20.0", "number", "s")
    assert duration.bounds == "above 0 to 1e+06"
    assert duration.meaning == "latest end of the run"


def test_choices_come_from_schema(schema):
    by_key = fields("delivery_mission", schema)
    assert by_key["sensors.gps.preset"].choices[:2] == ("rtk", "standard")
    assert by_key["communication.coupling"].choices == ("gauss_seidel", "jacobi")
    assert by_key["trajectory.phase.0.release"].choices == ("true", "false")


def test_segments_of_phases_have_fields_of_their_kind(schema):
    by_key = fields("delivery_mission", schema)
    assert by_key["trajectory.phase.1.z.rate"].text == "1.0"
    assert by_key["trajectory.phase.1.z.rate"].bounds == "above 0"


def test_segments_have_units_of_their_channel(schema):
    by_key = fields("delivery_mission", schema)
    assert (by_key["trajectory.phase.1.z.to"].unit, by_key["trajectory.phase.1.z.rate"].unit) == ("m", "m/s")
    units = {key: field.unit for key, field in by_key.items() if key.endswith((".yaw.to", ".yaw.rate"))}
    assert set(units.values()) <= {"rad", "rad/s"}
    assert units


@pytest.mark.parametrize("scene", sorted(path.stem for path in SHIPPED.glob("*.toml")))
def test_units_are_known_without_symbols(scene, schema):
    assert not [key for key, field in fields(scene, schema).items() if re.search(r"\bu\b", field.unit)]


@pytest.mark.parametrize("scene", sorted(path.stem for path in SHIPPED.glob("*.toml")))
def test_every_field_is_valid_key_of_its_scene(scene, schema):
    by_key = fields(scene, schema)
    assert len(by_key) > 20
    set_fields = {key: field for key, field in by_key.items() if field.text}
    empty = {key: field._replace(text="") for key, field in set_fields.items()}
    changed, faults = changes(empty.values(), {key: field.text for key, field in set_fields.items()}, ())
    assert faults == {}
    assert len(changed) == len(set_fields)
    load(scene, [change.override for change in changed])


def test_tables_that_scene_lacks_can_be_added(schema):
    scene = load("hover")
    names = dict(additions(scene, schema))
    assert "effects.battery" in names
    assert "effects.gravity" not in names
    assert not names.keys() & fields("hover", schema).keys()
    added = load("hover", {"effects.random_wind_force": {}})
    by_key = {field.key for group in form(added, schema) for field in group.all_fields()}
    assert "effects.random_wind_force.mean" in by_key


def test_added_tables_have_all_required_values(schema):
    def fault(key):
        try:
            load("hover", {key: starting_values(schema, key)})
        except SceneError as error:
            return f"{key}: {error}"
        return ""

    assert not [text for key, _ in additions(load("hover"), schema) if "missing" in (text := fault(key))]


def test_places_are_lists_in_metres(schema):
    place = {"latitude_deg": 40.7686, "longitude_deg": 14.7907}
    scene = load("hover", {"fence.keep_out": [{"position": place, "radius": 2.0}], "vehicle.initial_position": (5, 5)})
    texts = {field.key: field.text for group in form(scene, schema) for field in group.all_fields()}
    assert texts["fence.keep_out"] == "[{position = [0.0, 0.0], radius = 2.0}]"
    assert texts["fence.keep_in"] == texts["environment.terrain.box"] == "[]"


def test_unchanged_texts_add_no_overrides(schema):
    by_key = fields("delivery_mission", schema)
    assert changes(by_key.values(), {key: field.text for key, field in by_key.items()}, ()) == ([], {})


def test_texts_become_values_of_field(schema):
    by_key = fields("delivery_mission", schema)
    posted = {
        "run.seed": "2",
        "run.duration": "30",
        "run.stop_delay": "500 ms",
        "effects.random_wind_force.mean": "[1, 2.5, 0]",
        "sensors.gps.preset": "standard",
        "trajectory.phase.1.z.to": "8",
        "trajectory.phase.0.release": "true",
    }
    changed, faults = changes(by_key.values(), posted, ["effects.battery"])
    assert faults == {}
    assert dict(changed) == {
        "effects.battery": {},
        "run.seed": 2,
        "run.duration": 30.0,
        "run.stop_delay": "500 ms",
        "effects.random_wind_force.mean": [1, 2.5, 0],
        "sensors.gps.preset": "standard",
        "trajectory.phase.1.z.to": 8.0,
        "trajectory.phase.0.release": True,
    }
    scene = load("delivery_mission", [change.override for change in changed])
    assert scene == load("delivery_mission", dict(changed))
    assert (scene.lookup("run.seed"), scene.lookup("run.stop_delay")) == (2, 0.5)


@pytest.mark.parametrize(
    ("key", "text", "message"),
    [
        ("run.seed", "1.5", "got 1.5; expected a whole number"),
        ("run.duration", "long", "got long; expected a number, or one with s, ms, min, h"),
        ("run.duration", "[1]", "got [1]; expected a number"),
        ("effects.random_wind_force.mean", "3, 1", "got 3, 1; expected a TOML value, e.g. [1.0, 2.0]"),
        ("run.duration", "1\nx = 2", "got 1\nx = 2; expected a number, or one with s, ms, min, h"),
    ],
)
def test_text_of_wrong_type_is_fault(schema, key, text, message):
    by_key = fields("delivery_mission", schema)
    assert changes(by_key.values(), {key: text}, ()) == ([], {key: message})


def test_all_faults_of_form_are_named_at_once():
    forms = pytest.importorskip(
        "lapwing.views.studio.scene_forms", reason="needs starlette (pip install lapwing[studio])"
    )
    posted = {"run.duration": "long", "run.seed": "-3", "effects.random_wind_force.sigma": "99"}
    _, faults, message = forms.form_changes("delivery_mission", posted, ())
    assert {key: text.rpartition("got ")[2][:4] for key, text in faults.items()} == {
        "run.duration": "long",
        "run.seed": "-3",
        "effects.random_wind_force.sigma": "99.0",
    }
    assert message
    _, faults, _ = forms.form_changes("hover", {"trajectory.waypoints": "[[0, 0, 3], [7, 0]]"}, ())
    assert faults["trajectory.waypoints"].startswith("waypoints.1: expected x, y, z [m]")


def test_command_line_and_python_fly_same():
    changed = [Change("run.seed", 3), Change("vehicle.airframe", "my drone.toml"), Change("effects.battery", {})]
    words = command_line("hover", changed, "2", True)
    overrides = [words[k + 1] for k, word in enumerate(words) if word == "--set"]
    with pytest.raises(SceneError, match=r"my drone\.toml"):
        load("hover", overrides)
    assert load("hover", [o for o in overrides if "airframe" not in o]) == load(
        "hover", {change.key: change.value for change in changed if "airframe" not in change.key}
    )
    code = python("hover", changed)
    inputs = {}
    exec(
        code.replace("import lapwing\n", "").replace("print(flight.outcome)\nflight.report()\n", ""),
        {"lapwing": Spy(inputs)},
    )
    assert inputs == {"scene": "hover", "overrides": dict(changed)}


class Spy:
    def __init__(self, inputs):
        self._given = inputs

    def fly(self, scene, overrides=()):
        self._given.update(scene=scene, overrides=overrides)


@pytest.mark.parametrize(
    ("value", "text"),
    [(True, "true"), ('a "b"', '"a \\"b\\""'), ([1, 2.0], "[1, 2.0]"), ({"a b": {}}, '{"a b" = {}}'), (1e-9, "1e-09")],
)
def test_values_as_toml(value, text):
    assert toml(value) == text
