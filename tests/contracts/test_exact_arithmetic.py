"""Equal digests on all machines: no number comes from the C library, BLAS, LAPACK or SIMD loops of numpy.

The object code of kernels imports no function of the C library that rounds. The sources of the engine, the dynamics and
the lock-step services do not call one either, because they also compute parameters in plain Python.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.services.process_table import create_all
from tests.contracts.object_code import imported_by_kernels
from tests.golden.cases import CASES

ROOT = Path(__file__).parents[2]
MODULE = "tests.contracts.test_exact_arithmetic"
FOLDERS = (
    "lapwing/cosim/config", "lapwing/cosim/diagram", "lapwing/cosim/executors", "lapwing/dynamics", "lapwing/kernels",
    "messages", "services",
)  # fmt: skip
EXEMPT = {
    "lapwing/dynamics/multibody/simulation.py": "energies of the accuracy study",
    "lapwing/dynamics/vehicles/performance.py": "performance card",
    "lapwing/kernels/math": "the functions themselves, and the script of their coefficients",
    "services/betaflight/link.py": "real time: no two runs are equal",
    "services/betaflight/pilot.py": "real time",
    "services/betaflight/state_source.py": "real time",
    "services/autopilot/margins.py": "stability margins: gain design, and a warning before the flight",
    "services/common/mavlink": "beside the lock step",
    "services/mavlink": "beside the lock step",
}
ROUNDED_BY_LIBRARY = {
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "dist", "erf", "erfc", "exp",
    "exp2", "expm1", "fma", "fsum", "gamma", "hypot", "lgamma", "log", "log10", "log1p", "log2", "pow", "sin", "sinh",
    "sumprod", "tan", "tanh",
}  # fmt: skip
ROUNDED_BY_NUMPY = ROUNDED_BY_LIBRARY | {
    "arccos", "arccosh", "arcsin", "arcsinh", "arctan", "arctan2", "arctanh", "dot", "einsum", "geomspace", "inner",
    "linalg", "logspace", "matmul", "polyfit", "power", "tensordot", "vdot",
}  # fmt: skip
PREFIXES = ("NRT_", "Py", "_Py", "numba_", "mem", "_ZN")
EXACT = {"ceil", "floor", "fmod", "nearbyint", "rint", "trunc"}  # called on processors without SSE 4.1


def _sources():
    names = [path.relative_to(ROOT).as_posix() for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    return sorted(name for name in names if not name.startswith(tuple(EXEMPT)))


def _modules(tree):
    """Return the names of Python's math and of numpy in a source."""
    names = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.asname or alias.name: alias.name for alias in node.names}
    return names


def _is_exact_power(base):
    return (isinstance(base, ast.Constant) and base.value in (2, 2.0, 10)) or isinstance(base, ast.UnaryOp)


def _is_integer_sum(call):
    element = getattr(call.args[0], "elt", call.args[0])
    return isinstance(element, ast.Compare | ast.Constant) or (
        isinstance(element, ast.Call) and getattr(element.func, "id", "") in ("len", "map")
    )


def _offence(node, modules):
    match node:
        case ast.Attribute(value=ast.Name(id=name), attr=attribute) if modules.get(name) in ("math", "numpy"):
            known = ROUNDED_BY_LIBRARY if modules[name] == "math" else ROUNDED_BY_NUMPY
            return f"{name}.{attribute}" if attribute in known else None
        case ast.ImportFrom(module="math"):
            return "from math import"
        case ast.ImportFrom(module=str(module)) if module.partition(".")[0] == "scipy":
            return "scipy"
        case ast.BinOp(op=ast.MatMult()):
            return "@"
        case ast.BinOp(left=base, op=ast.Pow()):
            return None if _is_exact_power(base) else "**"
        case ast.Call(func=ast.Name(id="sum")):
            return None if _is_integer_sum(node) else "sum"
    return None


@pytest.mark.parametrize("name", _sources())
def test_sources_call_no_function_that_rounds_differently(name):
    tree = ast.parse((ROOT / name).read_text())
    modules = _modules(tree)
    result = [f"line {node.lineno}: {text}" for node in ast.walk(tree) if (text := _offence(node, modules))]
    assert not result, "use lapwing.kernels.math or lapwing.dynamics.small_matrices"


def imported_by_scenes():
    """Return the kernels that import each function, after a few ticks of every scene in this process."""
    for case in CASES.values():
        config = case.resolve()
        BlockDiagram(config, create_all(config), 16).advance(2)
    return imported_by_kernels()


@pytest.mark.long
def test_object_code_imports_no_function_that_rounds():
    script = f"from {MODULE} import imported_by_scenes as f; print({{k: sorted(v) for k, v in f().items()}})"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    imported = ast.literal_eval(done.stdout.splitlines()[-1])
    foreign = {name: kernels for name, kernels in imported.items() if not name.startswith(PREFIXES)}
    assert not {name: kernels for name, kernels in foreign.items() if name not in EXACT}
