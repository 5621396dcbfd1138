"""`lapwing schema`: output, file, user errors."""

import json

import pytest


@pytest.mark.parametrize("kind", ["scene", "airframe", "gains"])
def test_schema_is_json(lapwing, tmp_path, kind):
    code, out, _ = lapwing("schema", kind)
    assert code == 0
    assert json.loads(out)["type"] == "object"
    assert lapwing("schema", kind, "--out", tmp_path / "schema.json") == (0, "", "")
    assert (tmp_path / "schema.json").read_text() == out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["scnee"], "KIND: unknown kind of file 'scnee'; did you mean scene? expected one of airframe, gains, scene"),
        (["--out", "-"], "-: standard output is not supported here; expected the path of an output"),
        (["--out", "none/page.json"], "none/page.json: cannot be written"),
    ],
)
def test_schema_rejects_bad_arguments_in_one_line(lapwing, arguments, message):
    code, out, err = lapwing("schema", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("lapwing: ")
    assert err.count("\n") == 1
    assert message in err
