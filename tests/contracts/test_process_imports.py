"""What a process of the lock step imports of others: what it needs to fly, nothing that resolves, draws or prints."""

import subprocess
import sys
from io import BytesIO

import pytest

from services.participant import Participation, hand_over
from services.table import load, resolve

pytestmark = pytest.mark.long

OWN = {"cosim", "dynamics", "messages", "services"}
NEEDED = {"annotated_types", "llvmlite", "numba", "numpy", "typing_extensions", "zenoh"}
# numpy's, and what numba imports where it is installed
BY_OTHERS = {"cffi", "cython_runtime", "pycparser", "scipy", "yaml"}
CHILD = """
import sys
before = set(sys.modules)
from services.participant import take_over
given = take_over()
import cosim.bus, cosim.lockstep
from services import processes
processes.create(given.setup, given.name)
print(*sorted(set(sys.modules) - before))
"""


@pytest.fixture(scope="module")
def setup():
    return resolve(load("delivery_mission"))


@pytest.mark.parametrize("name", ["plant", "sensors", "autopilot", "trajectory"])
def test_a_process_imports_what_it_needs_to_fly(setup, name):
    given = BytesIO()
    hand_over(Participation(name, setup, {}, "lapwing"), given)
    ended = subprocess.run([sys.executable, "-P", "-c", CHILD], input=given.getvalue(), capture_output=True, check=True)
    modules = ended.stdout.decode().split()
    packages = {module.partition(".")[0] for module in modules} - sys.stdlib_module_names
    assert {p for p in packages if not p.startswith("_")} - OWN - BY_OTHERS <= NEEDED
    parts = {".".join(module.split(".")[:2]) for module in modules if module.startswith("scipy.")}
    assert {p for p in parts if not p.startswith("scipy._")} <= {"scipy.linalg", "scipy.version"}  # numba: BLAS
