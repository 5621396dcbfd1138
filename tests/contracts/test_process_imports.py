"""Imports of lock-step processes: only those needed to fly, no resolver, plots or console."""

import subprocess
import sys
from io import BytesIO

import pytest

from lapwing.services.process_main import ProcessSpec, write_spec
from lapwing.services.scene_resolver import load, resolve

pytestmark = pytest.mark.long

OWN = {"lapwing"}
NEEDED = {"annotated_types", "llvmlite", "numba", "numpy", "typing_extensions", "zenoh"}
# optional imports of numpy and numba
BY_OTHERS = {"cffi", "charset_normalizer", "colorama", "cython_runtime", "pycparser", "scipy", "yaml"}
CHILD = """
import sys
before = set(sys.modules)
from lapwing.services.process_main import read_spec
given = read_spec()
import lapwing.cosim.transport.bus, lapwing.cosim.executors.lockstep
from lapwing.services import process_table
process_table.create(given.config, given.name)
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
def config():
    return resolve(load("delivery_mission"))


@pytest.mark.parametrize("name", ["plant", "sensors", "autopilot", "trajectory"])
def test_process_imports_are_minimal(config, name):
    values = BytesIO()
    write_spec(ProcessSpec(name, config, {}, "lapwing"), values)
    ended = subprocess.run(
        [sys.executable, "-P", "-c", CHILD], input=values.getvalue(), capture_output=True, check=True
    )
    modules = ended.stdout.decode().split()
    packages = {module.partition(".")[0] for module in modules} - sys.stdlib_module_names
    assert {p for p in packages if not p.startswith("_")} - OWN - BY_OTHERS <= NEEDED
    check_scipy(modules)


def check_scipy(modules):
    parts = {".".join(module.split(".")[:2]) for module in modules if module.startswith("scipy.")}
    assert {p for p in parts if not p.startswith("scipy._")} <= {"scipy.linalg", "scipy.version"}  # numba: BLAS


def test_scene_is_loaded_without_scipy_and_mavlink():
    """Importing SciPy takes longer than loading a scene; importing MAVLink messages takes a third of that time."""
    code = "from lapwing.cli.preflight import with_solver_selected as load; load('groundstation', [])"
    command = [sys.executable, "-P", "-c", f"{code}; import sys; print(*sys.modules)"]
    modules = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    check_scipy(modules)
    assert not [m for m in modules if m.startswith("pymavlink")]


def test_fork_imports_no_resolver_plot_or_console_module(tmp_path):
    command = [sys.executable, "-c", FORKED, tmp_path / "l.mcap", tmp_path / "r.html"]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    result = {line for line in output.splitlines() if line.startswith("at the fork:")}
    assert result
    for line in result:
        modules = line.split()[3:]
        assert not {m.partition(".")[0] for m in modules} & {"rich", "jinja2", "control", "matplotlib", "plotly"}
        assert not [m for m in modules if m.endswith(".resolve")]
        check_scipy(modules)
