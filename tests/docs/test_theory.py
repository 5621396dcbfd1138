"""Equations of the theory: their numbers are unique, and code cites numbers that exist."""

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
CITATION = re.compile(r"theory,\s+eqs?\.\s+((?:\(\d+\.\d+\w?\)(?:,\s+|\s+and\s+|\s+to\s+)?)+)")
NUMBER = re.compile(r"\((\d+\.\d+\w?)\)")
SOURCES = ("lapwing", "services", "messages", "tests", "docs")


def numbers():
    pages = (ROOT / "docs/explanation/theory").glob("*.md")
    return Counter(number for page in pages for number in re.findall(r"\*\*\((\d+\.\d+\w?)\)\*\*", page.read_text()))


def test_equation_numbers_are_unique():
    assert [number for number, count in numbers().items() if count > 1] == []


def test_cited_equations_exist():
    known, missing, cited = numbers(), [], 0
    for path in (path for folder in SOURCES for kind in ("py", "md") for path in (ROOT / folder).rglob(f"*.{kind}")):
        for citation in CITATION.findall(path.read_text()):
            found = NUMBER.findall(citation)
            cited += len(found)
            missing += [f"{path.relative_to(ROOT)}: ({number})" for number in found if number not in known]
    assert missing == []
    assert cited > 200
