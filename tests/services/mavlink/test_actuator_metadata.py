"""Actuator metadata for ground stations, checked as by QGroundControl."""

import json

import jsonschema
import pytest

from lapwing.services.mavlink.component_metadata import ACTUATORS, GENERAL, PARAMETERS, files
from lapwing.services.mavlink.resolve import describe
from lapwing.services.scene_resolver import load

NUMBER, TEXT = {"type": "number"}, {"type": "string"}


def table(required, **more):
    """Return the schema of an object with these keys and the optional ones of `more`."""
    return {"type": "object", "properties": required | more, "required": list(required), "additionalProperties": False}


def several(items):
    return {"type": "array", "items": items, "minItems": 1}


RANGE = table({"min": NUMBER, "max": NUMBER}, default=NUMBER)
WHOLE = {"type": "integer"}
SCHEMA = table(
    {
        "version": {"type": "integer", "minimum": 2},
        "outputs_v1": several(
            table(
                {
                    "label": TEXT,
                    "subgroups": several(
                        table(
                            {
                                "per-channel-parameters": several(
                                    table({"label": TEXT, "name": TEXT, "function": TEXT})
                                ),
                                "channels": several(table({"label": TEXT, "param-index": WHOLE})),
                            }
                        )
                    ),
                }
            )
        ),
        "functions_v1": {
            "type": "object",
            "additionalProperties": table({"label": TEXT}, **{"exclude-from-actuator-testing": {"type": "boolean"}}),
            "propertyNames": {"pattern": "^[0-9]+$"},
        },
        "mixer_v1": table(
            {
                "actuator-types": table(
                    {
                        "DEFAULT": table({"values": RANGE}),
                        "motor": table(
                            {"values": RANGE, "function-min": WHOLE, "function-max": WHOLE},
                            **{"label-index-offset": WHOLE},
                        ),
                    }
                ),
                "config": several(
                    table(
                        {
                            "option": {"type": "string", "pattern": "^[A-Z_]{1,16}==[0-9]+$"},
                            "type": {"const": "multirotor"},
                            "title": TEXT,
                            "actuators": several(
                                table(
                                    {
                                        "group-label": TEXT,
                                        "actuator-type": {"const": "motor"},
                                        "required": {"const": True},
                                        "count": WHOLE,
                                        "per-item-parameters": several(
                                            table(
                                                {
                                                    "label": TEXT,
                                                    "function": {"enum": ["posx", "posy", "posz", "spin-dir"]},
                                                    "value": several(NUMBER),
                                                }
                                            )
                                        ),
                                    }
                                )
                            ),
                        }
                    )
                ),
            }
        ),
    }
)


@pytest.fixture(scope="module")
def metadata():
    return files(describe(load("groundstation")))


def test_actuator_metadata_match_schema(metadata):
    jsonschema.validate(json.loads(metadata[ACTUATORS]), SCHEMA)


def test_every_required_motor_is_driven_by_output(metadata):
    """Check the outputs: QGroundControl's summary would otherwise request a setup."""
    described = json.loads(metadata[ACTUATORS])
    values = {p["name"]: p["default"] for p in json.loads(metadata[PARAMETERS])["parameters"]}
    (subgroup,) = described["outputs_v1"][0]["subgroups"]
    (function,) = subgroup["per-channel-parameters"]
    driven = [values[function["name"].replace("${i}", str(c["param-index"]))] for c in subgroup["channels"]]
    motor = described["mixer_v1"]["actuator-types"]["motor"]
    assert driven == list(range(motor["function-min"], motor["function-max"] + 1)) == [101, 102, 103, 104]
    assert set(described["functions_v1"]) == {"0", *map(str, driven)}
    (geometry,) = described["mixer_v1"]["config"]
    name, _, value = geometry["option"].partition("==")
    assert values[name] == int(value)
    assert values["CA_ROTOR_COUNT"] == geometry["actuators"][0]["count"] == 4


def test_geometry_is_forward_right_down(metadata):
    """Check rotor 1 of the delivery drone: front left and clockwise, as in its airframe."""
    (group,) = json.loads(metadata[ACTUATORS])["mixer_v1"]["config"][0]["actuators"]
    value = {p["function"]: p["value"] for p in group["per-item-parameters"]}
    arm = 0.35171491
    assert value["posx"] == pytest.approx([arm, -arm, -arm, arm])
    assert value["posy"] == pytest.approx([-arm, -arm, arm, arm])
    assert value["posz"] == pytest.approx([0.0] * 4)
    assert value["spin-dir"] == [0.0, 1.0, 0.0, 1.0]


def test_ardupilot_stations_get_no_facts():
    metadata = files(describe(load("groundstation", ["mavlink.firmware=ardupilot"])))
    assert ACTUATORS not in metadata
    assert len(json.loads(metadata[GENERAL])["metadataTypes"]) == 1  # the parameters
