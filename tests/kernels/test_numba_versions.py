"""Compilation with versions of numba that the compile pipeline does not know."""

import json

import pytest

from lapwing.kernels.compiler import numba_versions

# The process reports another version of numba, and the parts of llvmlite that only the pipeline uses are missing.
UNKNOWN = """
import sys
import numba
numba.__version__ = "9.9.0"
sys.modules["llvmlite.binding.newpassmanagers"] = None
"""
CALLS = """
from plant import law, outer, outermost, table
values.update(outer=outer.outer(3.0), outermost=outermost.outermost(2.0), total=table.total(law.Spring(4.0)))
"""


@pytest.mark.parametrize(
    ("version", "expected"),
    [("0.62.1", False), ("0.63.1", True), ("0.68.1", True), ("0.69.0", False), ("1.0.0rc1", False), ("dev", False)],
)
def test_version_range_includes_both_ends(version, expected):
    assert numba_versions._is_within(version, *numba_versions.NUMBA) is expected


def _run(package):
    out, errors = (process := package.start(CALLS)).communicate()
    assert process.returncode == 0, errors
    return json.loads(out), errors.splitlines()


@pytest.mark.long
def test_unknown_numba_compiles_with_equal_results(package):
    known, no_lines = _run(package)
    (package.folder / "sitecustomize.py").write_text(UNKNOWN)
    unknown, lines = _run(package)
    assert unknown["values"] == known["values"] == {"outer": 7.0, "outermost": 21.0, "total": 40.0}
    assert no_lines == []
    assert len(lines) == 1
    assert "numba 9.9.0" in lines[0]
    again, _ = _run(package)
    assert (again["compiled"], again["values"]) == (0, known["values"])
