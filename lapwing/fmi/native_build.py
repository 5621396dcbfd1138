"""Compilation and linking of exported parts with the C compiler of this machine, or that of the package `ziglang`."""

import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from lapwing.fmi.c_tables import tables
from lapwing.fmi.exported_part import ExportedPart
from lapwing.fmi.machine_code import data_object, step_code
from lapwing.fmi.variables import Variable

NATIVE = Path(__file__).parent / "native"
FLAGS = ("-std=gnu11", "-Wall", "-Werror=implicit", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off")

CREATES_ARRAYS = "NRT_MemInfo_alloc_aligned"  # symbol that blocks with arrays of their own call
ARRAYS = 1 << 18  # [bytes] of the stack for these arrays; five bodies in Euler angles use 44 kB


@dataclass(frozen=True)
class BuildFolder:
    """A temporary folder with the object code of the blocks and the tables of a part.

    Attributes:
        path: the folder.
        objects: object files of blocks and image.
        prefix: first part of all symbols.
    """

    path: Path
    objects: tuple[Path, ...]
    prefix: str

    def compile(self, source: Path, *flags: str) -> Path:
        """Compile a C file against the tables. Return the object file."""
        out = self.path / f"{source.stem}.o"
        _run(
            [*compiler(), *FLAGS, *_symbol_names(self.prefix), *flags, f"-I{self.path}", f"-I{NATIVE}"],
            source,
            out,
            "-c",
        )
        return out

    def link(self, objects: Sequence[Path], out: Path, exported: str) -> None:
        """Link objects to a shared library that exports the symbols of a pattern and needs no other library."""
        script = self.path / "exported.map"
        script.write_text(f"{{ global: {exported}; local: *; }};\n", encoding="ascii")
        command = [*compiler(), "-shared", "-nostartfiles", "-Wl,-s", f"-Wl,--version-script={script}"]
        _run([*command, "-Wl,-z,defs", f"-Wl,-soname,{out.name}", *map(str, [*objects, *self.objects])], None, out)


# symbols of the runtime that must differ between static libraries of one program
_SYMBOLS = (
    "part_size", "part_reset", "part_relocate", "part_unlink", "part_advance", "part_staged", "part_row",
    "part_number", "part_set_number", "part_variable", "numba_frexp", "numba_attempt_nocopy_reshape", CREATES_ARRAYS,
    "NRT_MemInfo_call_dtor", "NRT_incref", "NRT_decref",
)  # fmt: skip


def _symbol_names(prefix: str) -> list[str]:
    return [f"-DLAPWING_PREFIX={prefix}", *(f"-D{name}={prefix}_{name}" for name in _SYMBOLS)]


@contextmanager
def build_folder(part: ExportedPart, variables: Sequence[Variable], prefix: str, cpu: str) -> Iterator[BuildFolder]:
    """Emit the object code of a part into a temporary folder.

    Raises:
        ValueError: no compiler, or a block that cannot be exported.
    """
    compiler()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        symbols: list[str | None] = []
        objects = [folder / "image.o"]
        objects[0].write_bytes(data_object(f"{prefix}_image", bytes(part.image.data)))
        emitted: dict[int, str] = {}  # symbols by address of the code here: blocks of the same types share it
        for k, block in enumerate(part.blocks):
            if block.bound and block.bound.function not in emitted:
                emitted[block.bound.function] = symbol = f"{prefix}_step_{k}"
                objects.append(folder / f"step_{k}.o")
                names = {each: f"{prefix}_{each}" for each in _SYMBOLS}
                objects[-1].write_bytes(step_code(block.part, block.bound, symbol, cpu, names))
            symbols.append(emitted[block.bound.function] if block.bound else None)
        creates = any(CREATES_ARRAYS.encode() in path.read_bytes() for path in objects)
        text = tables(part, symbols, variables, f"{prefix}_image", ARRAYS if creates else 0)
        (folder / "tables.h").write_text(text, encoding="ascii")
        yield BuildFolder(folder, tuple(objects), prefix)


def compiler() -> list[str]:
    """Return the command of a C compiler: $CC, cc, gcc, clang, or the package `ziglang`.

    Raises:
        ValueError: there is none.
    """
    if named := shlex.split(os.environ.get("CC", "")):
        if shutil.which(named[0]) is None:
            raise ValueError(f"CC={os.environ['CC']}: no such program; name a C compiler, or unset CC")
        return named
    for name in ("cc", "gcc", "clang"):
        if path := shutil.which(name):
            return [path]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-linux-gnu"]
    raise ValueError("C compiler: none found; install gcc or clang, or `pip install ziglang`")


def archive(objects: Sequence[Path], out: Path) -> None:
    """Write a static library.

    Raises:
        ValueError: no archiver.
    """
    result = next((name for name in ("ar", "llvm-ar") if shutil.which(name)), None)
    command = [result] if result else [sys.executable, "-m", "ziglang", "ar"]
    out.unlink(missing_ok=True)
    _run([*command, "rcsD", str(out), *map(str, objects)], None, None)


def _run(command: Sequence[str], source: Path | None, out: Path | None, *more: str) -> None:
    line = [*command, *more, *([str(source)] if source else []), *(["-o", str(out)] if out else [])]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = next((text for text in done.stderr.splitlines() if "error" in text), done.stderr.strip()[-200:])
        raise ValueError(f"{Path(command[0]).name}: {reason.strip()}; use a compiler for Linux on x86-64 (see CC)")
