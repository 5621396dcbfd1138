"""What a process of the lock step imports of others: what it needs to fly, nothing that resolves, draws or prints."""

import subprocess
import sys
from io import BytesIO

import pytest

from lapwing.services.process_main import ProcessSpec, hand_over
from lapwing.services.scene_resolver import load, resolve

pytestmark = pytest.mark.long

OWN = {"lapwing"}
NEEDED = {"annotated_types", "llvmlite", "numba", "numpy", "typing_extensions", "zenoh"}
# numpy's, and what numba imports where it is installed
BY_OTHERS = {"cffi", "charset_normalizer", "colorama", "cython_runtime", "pycparser", "scipy", "yaml"}
CHILD = """
import sys
before = set(sys.modules)
from lapwing.services.process_main import take_over
given = take_over()
import lapwing.cosim.transport.bus, lapwing.cosim.executors.lockstep
from lapwing.services import process_table
process_table.create(given.setup, given.name)
print(*sorted(set(sys.modules) - before))
"""

FORKED = """
import sys
from lapwing.cosim.processes import child_process as child
fork = child._fork
def noted(name):
    print("at the fork:", *sorted(sys.modules))
    return fork(name)
child._fork = noted
sys.argv = ["lapwing", "run", "hover", "--set", "run.duration=0.1", "--log", sys.argv[1], "--report", sys.argv[2]]
from lapwing.cli.entry_point import main
main()
"""


@pytest.fixture(scope="module")
def setup():
    return resolve(load("delivery_mission"))


@pytest.mark.parametrize("name", ["plant", "sensors", "autopilot", "trajectory"])
def test_a_process_imports_what_it_needs_to_fly(setup, name):
    given = BytesIO()
    hand_over(ProcessSpec(name, setup, {}, "lapwing"), given)
    ended = subprocess.run([sys.executable, "-P", "-c", CHILD], input=given.getvalue(), capture_output=True, check=True)
    modules = ended.stdout.decode().split()
    packages = {module.partition(".")[0] for module in modules} - sys.stdlib_module_names
    assert {p for p in packages if not p.startswith("_")} - OWN - BY_OTHERS <= NEEDED
    check_scipy(modules)


def check_scipy(modules):
    parts = {".".join(module.split(".")[:2]) for module in modules if module.startswith("scipy.")}
    assert {p for p in parts if not p.startswith("scipy._")} <= {"scipy.linalg", "scipy.version"}  # numba: BLAS


def test_a_fork_of_the_command_has_nothing_that_resolves_draws_or_prints(tmp_path):
    command = [sys.executable, "-c", FORKED, tmp_path / "l.mcap", tmp_path / "r.html"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = {line for line in said.splitlines() if line.startswith("at the fork:")}
    assert found
    for line in found:
        modules = line.split()[3:]
        assert not {m.partition(".")[0] for m in modules} & {"rich", "jinja2", "control", "matplotlib", "plotly"}
        assert not [m for m in modules if m.endswith(".resolve")]
        check_scipy(modules)
