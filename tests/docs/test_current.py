"""Documentation: reference pages are current, the Python page lists the public names, links between pages resolve."""

import re
import runpy
from pathlib import Path

import pytest

import lapwing

DOCS = Path(__file__).parents[2] / "docs"


def test_python_page_lists_public_names():
    listed = set(re.findall(r"^### (\w+)$", (DOCS / "reference/python.md").read_text(), re.MULTILINE))
    assert set(lapwing.__all__) <= listed


def test_reference_pages_are_current():
    pytest.importorskip("gymnasium")  # whose environments the Python page describes
    pages = runpy.run_path(str(DOCS / "site/reference.py"))["pages"]()
    written = {name: (DOCS / "reference" / name).read_text() for name in pages if (DOCS / "reference" / name).exists()}
    assert written == pages, "python docs/site/reference.py"
    assert {f"scene/{page.name}" for page in (DOCS / "reference/scene").iterdir()} <= set(pages)


@pytest.mark.parametrize("page", [DOCS.parent / "README.md", *sorted(DOCS.rglob("*.md"))], ids=lambda page: page.name)
def test_links_resolve(page):
    text = re.sub(r"```.*?```|`[^`\n]*`|\$[^$\n]*\$", "", page.read_text(), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if not target.startswith(("http", "#")):
            assert (page.parent / target.partition("#")[0]).exists(), target


def test_threat_model_names_existing_tests():
    page = (DOCS / "explanation/security.md").read_text()
    names = set(re.findall(r"`(tests/[\w/]+\.py)`", page))
    assert len(names) >= 10
    assert [name for name in sorted(names) if not (DOCS.parent / name).exists()] == []
