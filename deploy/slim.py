"""Reduce the size of a folder of installed packages: remove tests, headers, unused modules and symbols.

Used by the Dockerfile:  python3 slim.py SITE_PACKAGES...
"""

import shutil
import struct
import sys
from pathlib import Path

UNUSED = {".pyi", ".pxd", ".pyx", ".c", ".h", ".hpp", ".a"}  # for type checkers and C compilers
# pymavlink needs lxml only to generate dialects; plotly needs narwhals, but only its script is read; dateutil and
# pydantic need tzdata for time zones by name, which Lapwing does not use.
NOT_IMPORTED = ("lxml", "narwhals", "tzdata", "dask/array", "dask/dataframe", "numpy/distutils")
PLOTLY_SCRIPT = Path("package_data", "plotly.min.js")
# Modules of these folders that are kept: the MAVLink dialects of the link and the default one of pymavlink; the lexers
# of tracebacks.
MODULES = {
    "pymavlink/dialects/v*": {"__init__", "all"},
    "pygments/lexers": {"__init__", "_mapping", "diff", "python", "special"},
}
ELF64_LITTLE = b"\x7fELF\x02\x01"
PT_LOAD_END = slice(8, 40)  # p_offset, p_vaddr, p_paddr, p_filesz of an Elf64_Phdr


def loadable_end(elf: bytes) -> int:
    """Return the end [bytes] of the last segment in the program headers of an ELF64 file."""
    table, entry, count = struct.unpack_from("<Q", elf, 32)[0], *struct.unpack_from("<HH", elf, 54)
    end = table + entry * count
    for k in range(count):
        offset, _, _, size = struct.unpack("<4Q", elf[table + k * entry :][PT_LOAD_END])
        end = max(end, offset + size)
    return end


def strip(path: Path) -> int:
    """Truncate a shared library after its last segment: symbols, debug data, section headers. Return the saved bytes.

    The dynamic loader reads program headers only. Replaces `strip` of binutils, which slim base images lack.
    """
    elf = path.read_bytes()
    if not elf.startswith(ELF64_LITTLE):
        return 0
    end = loadable_end(elf)
    head = bytearray(elf[:64])
    head[40:48] = bytes(8)  # e_shoff
    head[60:64] = bytes(4)  # e_shnum, e_shstrndx
    path.write_bytes(bytes(head) + elf[64:end])
    return len(elf) - end


def remove(folder: Path) -> int:
    """Remove a folder. Return the saved bytes."""
    saved = sum(f.stat().st_size for f in folder.rglob("*") if f.is_file())
    shutil.rmtree(folder)
    return saved


def keep(folder: Path, file: Path) -> int:
    """Remove all files of a folder except one. Return the saved bytes."""
    others = [path for path in folder.rglob("*") if path.is_file() and path != folder / file]
    saved = sum(path.stat().st_size for path in others)
    for path in others:
        path.unlink()
    for path in sorted((path for path in folder.rglob("*") if path.is_dir()), reverse=True):
        if not any(path.iterdir()):
            path.rmdir()
    return saved


def slim(packages: Path) -> int:
    """Reduce one folder of packages. Return the saved bytes."""
    saved = 0
    for folder in sorted(packages.rglob("tests"), reverse=True):
        if folder.is_dir():
            saved += remove(folder)
    for folder in [packages / name for name in NOT_IMPORTED]:
        if folder.is_dir():
            saved += remove(folder)
    if (packages / "plotly").is_dir():
        saved += keep(packages / "plotly", PLOTLY_SCRIPT)
    for path in [path for path in packages.rglob("*.*") if path.suffix in UNUSED]:
        saved += path.stat().st_size
        path.unlink()
    for folder, modules in MODULES.items():
        for path in packages.glob(f"{folder}/**/*.*"):
            if path.suffix == ".xml" or path.name.split(".")[0] not in modules:
                saved += path.stat().st_size
                path.unlink()
    return saved + sum(strip(path) for path in packages.rglob("*.so*") if not path.is_symlink())


if __name__ == "__main__":
    for name in sys.argv[1:]:
        print(f"{name}: {slim(Path(name)) / 1e6:.0f} MB saved")
