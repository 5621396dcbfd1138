"""Compilation and linking of exported parts with the C compiler of this machine, or that of the package `ziglang`.

The tables of a part are a C header, which `native/runtime.c` includes.
"""

import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from lapwing.fmi.export import variables as kinds
from lapwing.fmi.export.exported_part import BoundaryPort, ExportedPart
from lapwing.fmi.export.machine_code import data_object, step_code
from lapwing.fmi.export.variables import Variable
from lapwing.kernels.row_packing import pack_row, row_width

_PLACES = {kinds.INPUT: "INPUT", kinds.OUTPUT: "OUTPUT", kinds.PARAMETER: "NUMBER", kinds.STATE: "NUMBER"}
_TYPES = {kinds.REAL: "REAL", kinds.INTEGER: "INTEGER", kinds.BOOLEAN: "BOOLEAN"}
CONTACT = ".ground_contact"  # suffix of outputs whose change is an event


def tables(
    part: ExportedPart, symbols: Sequence[str | None], variables: Sequence[Variable], image: str, arrays: int
) -> str:
    """Return the text of tables.h.

    Args:
        part: part to export.
        symbols: function of each block; None for a Python block.
        variables: variables in the order of their references from 1.
        image: symbol of the image.
        arrays: size of the arrays that blocks create in a step [bytes].
    """
    actions, writes, written = _actions(part)
    staged = [float(x) for port in part.inputs for x in pack_row(port.port.example)]
    blocks = [
        f"{{{symbol or 'NULL'}, {part.image.cells[_rank(part, k)] if block.bound else 0}, {block.every},"
        f" {block.vehicle}, {block.until}, {block.following}}}"
        for k, (block, symbol) in enumerate(zip(part.blocks, symbols, strict=True))
    ]
    contacts = [k for k, each in enumerate(variables, 1) if each.name.endswith(CONTACT)]
    sizes = {
        "IMAGE_SIZE": len(part.image.data),
        "RELOCATIONS": len(part.image.relocations),
        "BLOCKS": len(blocks) - part.replacements,
        "VEHICLES": 1 + max(block.vehicle for block in part.blocks),
        "INPUTS": len(part.inputs),
        "STAGED": len(staged),
        "ACTIONS": len(actions),
        "VARIABLES": len(variables) + 1,
        "EVENTS": len(contacts),
        "FAILURES": len(part.events),
        "ARRAYS": arrays,
        "PART_IMAGE": image,
        "PART_INTERVAL": f"(1.0 / {part.config.rate})",
    }
    return "\n".join(
        [
            *(f"#define {name} {value}" for name, value in sizes.items()),
            f"extern const unsigned char {image}[];",
            *(f"extern step_function {symbol};" for symbol in dict.fromkeys(symbols) if symbol),
            _table("relocation", "part_relocations", (f"{{{at}, {to}}}" for at, to in part.image.relocations)),
            _table("block", "part_blocks", blocks),
            _table("port", "part_inputs", _ports(part, part.inputs)),
            _table("port", "part_outputs", _ports(part, part.outputs)),
            _table("double", "part_start", (_number(x) for x in staged)),
            _table("action", "part_actions", actions),
            _table("write_of", "part_writes", writes),
            _table("unsigned char", "part_written", (str(byte) for byte in written)),
            _table("variable", "part_variables", ['{"time", TIME, REAL, 0, 0, 0}', *map(_variable, variables)]),
            _table("uint32_t", "part_events", map(str, contacts)),
            _table("int64_t", "part_failures", map(str, part.events)),
            "",
        ]
    )


def _rank(part: ExportedPart, k: int) -> int:
    """Return the number of compiled blocks before block k."""
    return sum(block.bound is not None for block in part.blocks[:k])


def _table(kind: str, name: str, rows: Iterable[str]) -> str:
    texts = list(rows)
    return f"static const {kind} {name}[] = {{{', '.join(texts) or '0'}}};"


def _ports(part: ExportedPart, ports: Sequence[BoundaryPort]) -> list[str]:
    result, staged = [], 0
    for p in ports:
        width = row_width(p.port.example)
        result.append(f"{{{part.image.rows[p.ring]}, {p.depth}, {width}, {p.port.period}, {p.lag}, {staged}}}")
        staged += width
    return result


def _actions(part: ExportedPart) -> tuple[list[str], list[str], bytes]:
    """Return the rows of the tables of actions and writes, and the bytes written."""
    order = {block.block.name: k for k, block in enumerate(part.blocks)}
    actions: list[str] = []
    writes: list[str] = []
    written = bytearray()
    for a in sorted(part.actions, key=lambda a: (a.tick, order[a.block])):
        actions.append(f"{{{a.tick}, {order[a.block]}, {len(writes)}, {len(a.writes)}}}")
        for offset, data in a.writes:
            writes.append(f"{{{offset}, {len(written)}, {len(data)}}}")
            written += data
    return actions, writes, bytes(written)


def _variable(v: Variable) -> str:
    tunable = int(v.causality == kinds.PARAMETER)
    return f'{{"{v.name}", {_PLACES[v.causality]}, {_TYPES[v.type]}, {tunable}, {v.port}, {v.offset}}}'


def _number(x: float) -> str:
    return "(0.0 / 0.0)" if x != x else f"({x!r})".replace("inf", "1.0 / 0.0")


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
                objects[-1].write_bytes(step_code(block.block, block.bound, symbol, cpu, names))
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
