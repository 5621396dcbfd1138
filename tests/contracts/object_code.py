"""Symbols that compiled kernels import, read from their object code (ELF, 64 bits, little-endian)."""

import gc
import struct
from typing import Any

from lapwing.kernels.compiler.code_libraries import InnerLibrary
from lapwing.kernels.compiler.pipeline import KernelDispatcher

SYMBOL_TABLE = 2  # type of a section


def undefined_symbols(code: bytes) -> set[str]:
    """Return the names of the symbols that an object file refers to and does not define."""
    assert code[:6] == b"\x7fELF\x02\x01", "expected an ELF object of 64 bits, little-endian"
    (sections,), (size, count) = struct.unpack_from("<Q", code, 40), struct.unpack_from("<HH", code, 58)
    headers = [struct.unpack_from("<IIQQQQIIQQ", code, sections + k * size) for k in range(count)]
    names = set()
    for _, kind, _, _, offset, length, link, _, _, entry in headers:
        if kind == SYMBOL_TABLE:
            texts = headers[link][4]
            for at in range(offset, offset + length, entry):
                name, _, _, section = struct.unpack_from("<IBBH", code, at)
                if section == 0 and name:
                    names.add(code[texts + name : code.index(b"\0", texts + name)].decode())
    return names


def _object_code(library: Any) -> bytes:
    """Return the object code of a library, as the cache stores it."""
    if library._compiled_object is not None:
        return library._compiled_object
    return library.codegen._tm.emit_object(library._get_module_for_linking())


def imported_by_kernels() -> dict[str, set[str]]:
    """Return, for every imported symbol, the kernels of this process that import it."""
    results: dict[str, set[str]] = {}
    for dispatcher in [each for each in gc.get_objects() if isinstance(each, KernelDispatcher)]:
        for result in dispatcher.overloads.values():
            if not isinstance(result.library, InnerLibrary):
                for symbol in undefined_symbols(_object_code(result.library)):
                    results.setdefault(symbol, set()).add(dispatcher.py_func.__qualname__)
    return results
