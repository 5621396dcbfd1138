"""Key of a compiled version of a kernel: a text that is equal in every process.

The key consists of the types of the arguments; of every function that the kernel can reach through names, closures and
tables (`DispatchTable`), with the constants that they take from their modules; and of all sources that can be in it.
A version whose key cannot be determined is not stored.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

import hashlib
import sys
from collections.abc import Iterable
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import llvmlite
import numba
import numpy as np
from numba.core import config, types
from numba.core.dispatcher import Dispatcher

from lapwing.kernels.compiler import source_digest
from lapwing.kernels.compiler.dispatch_table import DispatchTable

VERSIONED = {"builtins", "llvmlite", "numba", "numpy"}  # packages whose version is in every key
PLAIN = (bool, int, float, complex, str, bytes, type(None), type(...))


class NotKeptError(Exception):
    """Error for a kernel whose key would differ between processes."""


class Key(NamedTuple):
    """Key of one compiled version."""

    made_of: str  # digest of types, functions, constants and compiler
    sources: str  # digest of all sources that can be in the kernel
    modules: frozenset[str]  # modules of the sources


class Part(NamedTuple):
    """Text of one function, its references, and the values that the text was made from."""

    text: str
    functions: tuple[FunctionType, ...]
    modules: frozenset[str]

    references: tuple[tuple[dict, str, Any], ...]  # (namespace, name, value)


class _Writer:
    """Writer of texts that collects their references."""

    def __init__(self) -> None:
        self.functions: list[FunctionType] = []
        self.modules: set[str] = set()
        self.references: list[tuple[dict, str, Any]] = []
        self.mutable = False  # True if a value may have changed although it is the same object

    def value(self, value: Any) -> str:
        """Return the text of a constant, a class, a numba type or a function.

        Raises:
            NotKeptError: the value is none of these.
        """
        if isinstance(value, PLAIN):
            return f"{type(value).__name__} {value!r}"
        if isinstance(value, Dispatcher):
            self.functions.append(value.py_func)
            return f"{_name(value.py_func)} {sorted(value.targetoptions.items())}"
        if isinstance(value, types.Type):
            return self.of_type(value)
        if isinstance(value, type):
            return self.of_class(value)
        if isinstance(value, FunctionType):  # a placeholder for compiled code, found by its module
            self.modules.add(value.__module__)
            return _name(value)
        if isinstance(value, tuple):
            return f"{self.of_class(type(value))}({', '.join(map(self.value, value))})"
        self.mutable = True
        if isinstance(value, list):
            return f"[{', '.join(map(self.value, value))}]"
        if isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
            array = np.asarray(value)
            return f"{array.dtype.str} {array.shape} {hashlib.blake2b(array.tobytes()).hexdigest()}"
        raise NotKeptError(f"{type(value).__name__} has no text")

    def of_type(self, value: types.Type) -> str:
        """Return the text of a type; types with equal classes and keys are equal."""
        if isinstance(value, types.Dispatcher):
            return self.value(value.dispatcher)
        if id(value) not in _types:  # parts of a type with hundreds of numbers are in most types of a scene
            own = _Writer()
            inside = (value.key, value._fields) if isinstance(value, types.StructRef) else value.key
            text = f"{own.of_class(type(value))}[{own.value(inside)}]"
            _types[id(value)] = value, text, own.functions, own.modules
        _, text, functions, modules = _types[id(value)]
        self.functions += functions
        self.modules |= modules
        return text

    def of_class(self, value: type) -> str:
        """Return the text of a class: its name and its entries in dispatch tables."""
        module, name = value.__module__, value.__qualname__
        if module.partition(".")[0] in VERSIONED:
            return f"{module}.{name}"
        item: Any = sys.modules.get(module)
        for part in name.split("."):
            item = getattr(item, part, None)
        if item is not value or module == "__main__":
            raise NotKeptError(f"class {name} cannot be imported")
        self.modules.add(module)
        tables = sorted(DispatchTable.tables.items())  # modules are not imported in the same order everywhere
        entries = [f", {name}: {self.value(table[value])}" for name, table in tables if value in table]
        return f"{module}.{name}{''.join(entries)}"

    def of_global(self, path: str, namespace: dict, name: str, names: set[str], defined: bool) -> str:
        """Return the text of a global name; `defined`: the source of the module defines it."""
        value = namespace[name]
        self.references.append((namespace, name, value))
        if isinstance(value, ModuleType):
            if value.__name__.partition(".")[0] in VERSIONED:
                return value.__name__
            self.modules.add(value.__name__)
            inside = sorted(n for n in names if n in vars(value))
            return "\n".join(self.of_global(f"{path}.{n}", vars(value), n, set(), defined) for n in inside)
        try:
            return f"{path} = {self.value(value)}"
        except NotKeptError:
            if defined:
                return path
            raise


def _name(function: FunctionType) -> str:
    return f"{function.__module__}.{function.__qualname__}:{function.__code__.co_firstlineno}"


def _codes(code: CodeType) -> Iterable[CodeType]:
    """Return the code of a function and of its inner functions."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


_parts: dict[FunctionType, Part] = {}
_types: dict[int, tuple[types.Type, str, list[FunctionType], set[str]]] = {}  # by identity: types are unique
_entered = 0  # of the dispatch tables, whose entries are in both


def _part(function: FunctionType) -> Part:
    """Return the text of one function: its code and the references of its names, closure and defaults."""
    part = _parts.get(function)
    if part and all(namespace.get(name) is value for namespace, name, value in part.references):
        return part
    writer = _Writer()
    writer.modules.add(function.__module__)
    codes = list(_codes(function.__code__))
    names = {name for code in codes for name in code.co_names}
    inside = (*(cell.cell_contents for cell in function.__closure__ or ()), function.__defaults__)
    namespace = function.__globals__
    defined = namespace is getattr(sys.modules.get(function.__module__), "__dict__", None)
    lines = [
        _name(function),
        hashlib.blake2b(b"".join(code.co_code for code in codes), digest_size=16).hexdigest(),
        *(repr(value) for code in codes for value in code.co_consts if not isinstance(value, CodeType)),
        *(str(code.co_names) for code in codes),
        *map(writer.value, inside),
        *(writer.of_global(name, namespace, name, names, defined) for name in sorted(names) if name in namespace),
    ]
    part = Part("\n".join(lines), tuple(writer.functions), frozenset(writer.modules), tuple(writer.references))
    if not writer.mutable:
        _parts[function] = part
    return part


def key(dispatcher: Dispatcher, arguments: tuple, returns: Any, target: tuple) -> Key:
    """Return the key of a kernel's version for argument types.

    Args:
        dispatcher: the kernel.
        arguments: numba types.
        returns: prescribed numba type of the result, or None.
        target: numba's description of the processor.

    Raises:
        NotKeptError: no key is equal in every process.
    """
    global _entered
    if _entered != DispatchTable.entered:
        _parts.clear()
        _types.clear()
        _entered = DispatchTable.entered
    writer = _Writer()
    text = writer.value((dispatcher, *arguments, returns))
    reached, done = {text}, set()
    while writer.functions:
        function = writer.functions.pop()
        if function not in done:
            done.add(function)
            part = _part(function)
            reached.add(part.text)
            writer.functions += part.functions
            writer.modules |= part.modules
    modules = frozenset(m for m in writer.modules if m.partition(".")[0] not in VERSIONED)
    if "__main__" in modules or None in modules:
        raise NotKeptError("outside of a module")
    lines = [*_compiler(), str(target), *sorted(reached)]
    made_of = hashlib.blake2b("\n".join(lines).encode(), digest_size=16).hexdigest()
    try:
        return Key(made_of, source_digest.digest(modules), modules)
    except (OSError, SyntaxError) as error:
        raise NotKeptError(str(error)) from None


def _compiler() -> tuple[str, ...]:
    settings = (config.OPT, config.LOOP_VECTORIZE, config.SLP_VECTORIZE, config.BOUNDSCHECK, config.DEBUGINFO_DEFAULT)
    return (sys.version, numba.__version__, llvmlite.__version__, np.__version__, *map(str, settings))
