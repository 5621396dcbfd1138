"""The code blocks of the tutorial run unchanged, in order, in an empty folder."""

import re
from pathlib import Path

import matplotlib
import pytest

import lapwing

pytestmark = pytest.mark.long

PAGE = (Path(__file__).parents[2] / "docs/tutorials/first_flight.md").read_text()
BLOCKS = re.findall(r'```python(?: title="(.*?)")?\n(.*?)```', PAGE, re.DOTALL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))  # like a script in this folder
    before = matplotlib.get_backend()
    matplotlib.use("Agg")
    yield tmp_path
    matplotlib.use(before)


def test_tutorial_runs(folder):
    assert callable(lapwing.fly)
    assert len(BLOCKS) > 10
    names: dict = {}
    for title, block in BLOCKS:
        if title:
            (folder / title).write_text(block)
        else:
            exec(compile(block, "docs/tutorials/first_flight.md", "exec"), names)
    assert {path.name for path in folder.iterdir()} >= {"flights.png", "windy.mcap", "windy.html"}
