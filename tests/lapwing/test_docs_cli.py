"""`lapwing docs`: pages to the screen or to a file, and one line for every mistake."""

import json

import pytest


@pytest.mark.parametrize("page", ["reference", "api"])
def test_a_page_is_shown_or_written(lapwing, tmp_path, page):
    assert lapwing("docs", page, "--out", tmp_path / "page.md") == (0, "", "")
    assert lapwing("docs", page) == (0, (tmp_path / "page.md").read_text(), "")


@pytest.mark.parametrize("kind", ["scene", "airframe", "gains"])
def test_schemas_are_json(lapwing, kind):
    code, out, _ = lapwing("docs", "schema", "--of", kind)
    assert code == 0
    assert json.loads(out)["type"] == "object"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["schema", "--of", "scnee"], "'scnee' is not one of 'scene', 'airframe', 'gains'"),
        (["reference", "--out", "none/page.md"], "none/page.md: cannot be written: no such file or directory"),
        (["pages"], "No such command 'pages'"),
    ],
)
def test_mistakes_are_told_in_one_line(lapwing, arguments, expected):
    code, out, err = lapwing("docs", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("lapwing: ")
    assert err.count("\n") == 1
    assert expected in err
