"""Small package of kernels on disk, run in separate processes."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]

FILES = {
    "plant/__init__.py": "pass\n",
    "plant/constants.py": "GAIN = 2.0\n",
    "plant/inner.py": """
from lapwing.kernels import always_inline
from .constants import GAIN

@always_inline
def inner(x):
    return GAIN * x
""",
    "plant/outer.py": """
from lapwing.kernels import kernel
from plant import inner as below

@kernel
def outer(x):
    return below.inner(x) + 1.0
""",
    "plant/table.py": """
from numba.extending import overload
from lapwing.kernels import DispatchTable, kernel

FORCES = DispatchTable()

def force(p):
    raise NotImplementedError

@overload(force)
def _force(p):
    found = FORCES[p.instance_class]
    return lambda p: found(p)

@kernel
def total(p):
    return force(p)
""",
    "plant/spring.py": """
from typing import NamedTuple

class Spring(NamedTuple):
    stiffness: float
""",
    "plant/law.py": """
from lapwing.kernels import always_inline
from plant.spring import Spring
from plant.table import FORCES

@always_inline
def law(p):
    return 10.0 * p.stiffness

FORCES[Spring] = law
""",
    "plant/factory.py": """
from lapwing.kernels import kernel, noinline
from plant.inner import inner

def times(n):
    @kernel
    def product(x):
        return n * inner(x)
    return product

def shifted(n):
    @noinline
    def shift(x):
        return n + x

    @kernel
    def total(x):
        return shift(x) + 1.0
    return total
""",
    "plant/texts.py": """
from lapwing.kernels import kernel

@kernel
def text_hash(n):
    return hash("abcdefgh"[:n])
""",
    "plant/large.py": """
from lapwing.kernels import kernel, noinline

@noinline
def large(x):
    if x < 0.0:
        raise ValueError("below zero")
    return x * x

@kernel
def middle(x):
    return large(x) + large(2.0 * x)
""",
    "plant/outermost.py": """
from lapwing.kernels import kernel
from plant.large import middle

@kernel
def outermost(x):
    return middle(x) + 1.0
""",
    "plant/tuples.py": """
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.codegen import map_tuple

@always_inline
def product(factor, x, y):
    return factor * x * y

@kernel
def products(x):
    return map_tuple(product, x, (x, 1.0), (2.0, 3.0))

@kernel
def last(x):
    return map_tuple(product, x, (x, 1.0), (2.0, 3.0))[1]
""",
    "plant/slow.py": """
import os, time
from lapwing.kernels.codegen import overload_for
from lapwing.kernels import kernel

def held(x):
    raise NotImplementedError

@overload_for(held)
def _held(x):
    if "BEGUN" in os.environ:
        open(os.environ["BEGUN"], "w").close()
        time.sleep(60.0)
    return lambda x: x + 1.0

@kernel
def slow(x):
    return held(x)
""",
    "run.py": """
import json, sys
from lapwing.kernels import on_compile, statistics
compiling = []
on_compile(compiling.append)
values = {}
exec(sys.argv[1])
print(json.dumps({"values": values, "compiling": compiling, **statistics()._asdict()}))
""",
}


class Package:
    """The package and the kernel cache of its processes."""

    def __init__(self, folder: Path):
        self.folder, self.cache = folder, folder / "cache"
        for name, text in FILES.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)

    def edit(self, name: str, old: str, new: str) -> None:
        """Replace a text in a file of the package."""
        text = (self.folder / name).read_text()
        assert old in text
        (self.folder / name).write_text(text.replace(old, new))

    def start(self, statements: str, **environment: str) -> subprocess.Popen:
        """Start a process that runs statements, which put results into `values`."""
        settings = {
            **{key: value for key, value in os.environ.items() if not key.startswith("NUMBA")},
            "LAPWING_CACHE": str(self.cache),
            "PYTHONPATH": f"{self.folder}{os.pathsep}{ROOT}",
            "PYTHONDONTWRITEBYTECODE": "1",  # byte code detects changes only by the second
            **environment,
        }
        command = [sys.executable, str(self.folder / "run.py"), statements]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, env=settings, cwd=self.folder, stdout=pipe, stderr=pipe, text=True)

    def run(self, statements: str, **environment: str) -> dict[str, Any]:
        """Run such a process. Return its values, compiled names, and numbers of compiled and loaded kernels."""
        return self.end(self.start(statements, **environment))

    def end(self, process: subprocess.Popen) -> dict[str, Any]:
        """Wait for a started process. Return its results as `run` does."""
        out, errors = process.communicate()
        assert (process.returncode, errors) == (0, "")
        return json.loads(out)


@pytest.fixture
def package(tmp_path) -> Package:
    """Return a new package with an empty cache."""
    return Package(tmp_path)
