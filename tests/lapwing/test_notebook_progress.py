"""Progress bar of `fly`, `Simulator` and `campaign` in a notebook, as its front end receives it."""

import os
import re

import pytest

from tests.lapwing.test_work_progress import CALLS, SLOW

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")
pytest.importorskip("ipykernel")

SHORT = "import lapwing\nfor _ in range(20):\n    lapwing.Simulator('hover').reset()"


class FrontEnd(nbclient.NotebookClient):
    """Front end that keeps all pictures of each cell."""

    def process_message(self, message, cell, cell_index):
        """Keep the HTML of a display or of its update."""
        html = message["content"].get("data", {}).get("text/html")
        if html is not None:
            self.pictures[cell_index].append(html)
        return super().process_message(message, cell, cell_index)


@pytest.mark.long
def test_bar_appears_in_notebook_while_work_is_long(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.getcwd()]))
    (tmp_path / "slow.py").write_text(SLOW)
    cells = [SHORT, *(code for code, _ in CALLS.values())]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code) for code in cells])
    client = FrontEnd(notebook, timeout=None, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}})
    client.pictures = [[] for _ in cells]
    client.execute()
    assert client.pictures[0] == []
    for (_, expected), pictures in zip(CALLS.values(), client.pictures[1:], strict=True):
        bars = [html for html in pictures if "<progress" in html]
        assert any(re.search(expected, html) for html in bars), pictures
        assert pictures[-1] == ""  # emptied
