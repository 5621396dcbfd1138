"""The pages that are made from the code are what the code gives, and links between pages lead somewhere."""

import json
import re
from pathlib import Path

import pytest

import lapwing
from lapwing.docs.api_page import api
from lapwing.docs.json_schema import SCHEMAS
from lapwing.docs.reference_page import reference

DOCS = Path(__file__).parents[2] / "docs"


def test_the_scene_reference_is_current():
    assert (DOCS / "reference.md").read_text() == reference(), "lapwing docs reference --out docs/reference.md"


def test_the_api_reference_is_current():
    assert (DOCS / "api.md").read_text() == api(), "lapwing docs api --out docs/api.md"


def test_the_api_reference_says_all_that_can_be_imported_with_its_units_and_errors():
    page = api()
    for name in lapwing.__all__:
        assert f"### lapwing.{name}\n" in page or f"### {name}\n" in page, name
    said = (
        "- `controller`: ",
        "| `volts` | `tuple[float, ...]` | V |",
        "shape (n, 6)",
        "- `SceneError`: ",
    )
    assert all(words in page for words in said)


@pytest.mark.parametrize("kind", SCHEMAS)
def test_schemas_are_current(kind):
    path = DOCS / f"{kind}.schema.json"
    assert json.loads(path.read_text()) == SCHEMAS[kind](), f"lapwing docs schema --of {kind} --out docs/{path.name}"


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?```|`[^`\n]*`|\$[^$\n]*\$", "", page.read_text(), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if not target.startswith(("http", "#")):
            assert (page.parent / target.partition("#")[0]).exists(), target
