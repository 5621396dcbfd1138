"""Time per call of the elementary functions compared with the C library, and with SVML if it is installed.

A compiled loop over an array of arguments of usual size. SVML computes four values per call, in the variant with an
error below 1 ulp. It is located in the environment (`pip install intel-cmplr-lib-rt`) or by the loader.
"""

import ctypes
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import njit

from benchmarks._command import command_line
from lapwing.kernels import math as functions
from lapwing.kernels import vectorise_loops

COUNT = 4096
REPEATS = 200
RANGES = {
    "sin": (-4.0, 4.0), "cos": (-4.0, 4.0), "tan": (-4.0, 4.0), "asin": (-1.0, 1.0), "acos": (-1.0, 1.0),
    "atan": (-3.0, 3.0), "exp": (-10.0, 1.0), "expm1": (-1.0, 1.0), "log": (0.01, 10.0), "log1p": (-0.5, 10.0),
    "sqrt": (0.0, 10.0), "cbrt": (-10.0, 10.0), "tanh": (-3.0, 3.0), "atan2": (-1.0, 1.0), "hypot": (-1.0, 1.0),
    "pow": (0.1, 3.0),
}  # fmt: skip
PAIRS = ("atan2", "hypot", "pow")
_ENGINES: list[Any] = []  # owners of the code of the loops over SVML


def _loop(function: Any, pairs: bool) -> Any:
    if pairs:

        @vectorise_loops
        def run(result, x, y):
            for i in range(x.size):
                result[i] = function(x[i], y[i])
    else:

        @vectorise_loops
        def run(result, x):
            for i in range(x.size):
                result[i] = function(x[i])

    return run


def nanoseconds(run: Callable[..., Any], arguments: list[Any]) -> float:
    """Return the least time per call [ns]."""
    run(*arguments)
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter_ns()
        run(*arguments)
        times.append(time.perf_counter_ns() - start)
    return min(times) / COUNT


def svml() -> bool:
    """Return True if SVML is installed and loaded."""
    try:
        for name in ("libintlc.so.5", "libsvml.so"):  # the second needs the first
            path = Path(sys.prefix) / "lib" / name
            llvm.load_library_permanently(str(path) if path.exists() else name)
    except RuntimeError:
        return False
    return True


def _svml_loop(name: str, pairs: bool) -> Any:
    """Return a compiled loop over the calls of one function of SVML, four values at once."""
    inputs = ("x", "y") if pairs else ("x",)
    loads = "\n".join(
        f"%at_{v} = getelementptr double, ptr %{v}, i64 %i\n%{v}4 = load <4 x double>, ptr %at_{v}, align 8"
        for v in inputs
    )
    module = llvm.parse_assembly(f"""
        declare <4 x double> @__svml_{name}4_ha({", ".join("<4 x double>" for _ in inputs)})
        define void @run(ptr %result, ptr %x, ptr %y, i64 %size) {{
        entry:
          br label %loop
        loop:
          %i = phi i64 [0, %entry], [%next, %loop]
          {loads}
          %values = call <4 x double> @__svml_{name}4_ha({", ".join(f"<4 x double> %{v}4" for v in inputs)})
          %at = getelementptr double, ptr %result, i64 %i
          store <4 x double> %values, ptr %at, align 8
          %next = add i64 %i, 4
          %more = icmp ult i64 %next, %size
          br i1 %more, label %loop, label %end
        end:
          ret void
        }}""")
    machine = llvm.Target.from_default_triple().create_target_machine(cpu=llvm.get_host_cpu_name(), opt=3)
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    _ENGINES.append(engine)
    address = engine.get_function_address("run")
    call = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3, ctypes.c_int64)(address)

    @njit
    def run(result, x, y=None):
        call(result.ctypes, x.ctypes, x.ctypes if y is None else y.ctypes, x.size)

    return run


def main() -> None:
    """Print a line for each function."""
    rng = np.random.default_rng(1)
    has_svml = svml()
    print(f"| function | own [ns] | C library [ns] |{' SVML [ns] |' if has_svml else ''}")
    print(f"|---|---|---|{'---|' if has_svml else ''}")
    for name, (low, high) in RANGES.items():
        pairs = name in PAIRS
        arguments = [rng.uniform(low, high, COUNT) for _ in range(2 if pairs else 1)]
        theirs = np.cbrt if name == "cbrt" else getattr(math, name)
        runs = [_loop(getattr(functions, name), pairs), _loop(theirs, pairs)]
        if has_svml:
            runs.append(_svml_loop(name, pairs))
        times = [nanoseconds(run, [np.empty(COUNT), *arguments]) for run in runs]
        print(f"| {name} | {' | '.join(f'{value:.1f}' for value in times)} |", flush=True)


if __name__ == "__main__":
    command_line(main)
