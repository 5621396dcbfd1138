"""Notebook course: each notebook runs, has no stored output, and imports public names only."""

import ast
import json
from pathlib import Path

import pytest

from tests.combinations import rest_nightly

NOTEBOOKS = sorted((Path(__file__).parents[2] / "examples/notebooks").glob("*.ipynb"))
ALLOWED = {"lapwing", "lapwing.plugins", "math", "matplotlib.pyplot", "numpy", "plotly.graph_objects"}


def cells(path):
    return json.loads(path.read_text())["cells"]


def test_course_has_six_notebooks():
    assert len(NOTEBOOKS) == 6


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_stripped_and_imports_public_names(path):
    for cell in cells(path):
        if cell["cell_type"] != "code":
            continue
        assert (cell["outputs"], cell["execution_count"]) == ([], None)
        for node in ast.walk(ast.parse("".join(cell["source"]))):
            if isinstance(node, ast.Import):
                assert {alias.name for alias in node.names} <= ALLOWED
            elif isinstance(node, ast.ImportFrom):
                assert node.module in ALLOWED


@pytest.mark.long
@pytest.mark.parametrize("path", rest_nightly(*NOTEBOOKS), ids=lambda path: path.stem)
def test_notebook_runs_with_plots_and_3d_view(path, tmp_path):
    nbformat, nbclient = (
        pytest.importorskip(name, reason="needs lapwing[notebooks]") for name in ("nbformat", "nbclient")
    )
    book = nbformat.read(path, as_version=4)
    nbformat.validate(book)
    resources = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(book, timeout=None, kernel_name="python3", resources=resources).execute()
    shown = [output.get("data", {}) for cell in book.cells for output in cell.get("outputs", [])]
    assert any("image/png" in data for data in shown)
    assert any("<iframe" in data.get("text/html", "") for data in shown) == (path.stem != "3_integrators_and_accuracy")
