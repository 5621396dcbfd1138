"""Digest of the sources of modules and, transitively, of all modules that they import."""

import ast
import hashlib
import importlib.util
import os
import sys
import sysconfig
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from lapwing.kernels.compiler import cache_files
from lapwing.kernels.compiler.start_time import BEGAN
from lapwing.syntax_tree import parse

OURS = {"lapwing"}
STANDARD = (sysconfig.get_path("stdlib"), sysconfig.get_path("platstdlib"))
INSTALLED = {"site-packages", "dist-packages"}


class Source(NamedTuple):
    """One module: its file, the digest of the file, and the modules that it imports."""

    path: str
    digest: str
    imports: tuple[str, ...]


@cache
def _file(module: str) -> str | None:
    """Return the source file of a module without importing it, or None if there is none."""
    loaded = sys.modules.get(module)
    if loaded is not None:
        path = getattr(loaded, "__file__", None)
        return path if isinstance(path, str) and path.endswith(".py") else None
    package, _, name = module.rpartition(".")
    if not package:
        try:
            spec = importlib.util.find_spec(module)
        except (ImportError, ValueError):
            return None
        return spec.origin if spec and spec.origin and spec.origin.endswith(".py") else None
    for folder in _folders(package):
        for entry, path in ((name, f"{folder}/{name}/__init__.py"), (f"{name}.py", f"{folder}/{name}.py")):
            if entry in _entries(folder) and os.path.isfile(path):
                return path
    return None


@cache
def _folders(package: str) -> tuple[str, ...]:
    """Return the folders of the modules of a package; () for a plain module."""
    loaded = sys.modules.get(package)
    if loaded is not None:
        return tuple(getattr(loaded, "__path__", ()))
    path = _file(package)
    if path is not None:
        return (os.path.dirname(path),) if os.path.basename(path) == "__init__.py" else ()
    above, _, name = package.rpartition(".")
    if above:
        return tuple(f"{folder}/{name}" for folder in _folders(above) if name in _entries(folder))
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        return ()
    return tuple(spec.submodule_search_locations or ()) if spec else ()


@cache
def _entries(folder: str) -> frozenset[str]:
    try:
        return frozenset(os.listdir(folder))
    except OSError:
        return frozenset()


@cache
def _kind(package: str) -> str:
    """Return "followed", "stamped" (an external package), "standard" or "missing" for a top-level package."""
    place = _file(package) or next(iter(_folders(package)), None)
    if place is None:
        return "standard" if package in sys.stdlib_module_names else "missing"
    if INSTALLED.intersection(Path(place).parts):
        return "stamped"
    return "standard" if place.startswith(STANDARD) else "followed"


@cache
def _source(module: str) -> Source:
    """Return a module with a file. Of an external package, named with a `*`, only its overall state counts."""
    path = _file(module.rstrip("*")) or ""
    if module.endswith("*"):
        state = os.stat(path)
        return Source("", f"{int(state.st_mtime)} {state.st_size}", ())
    with open(path, "rb") as file:
        content = file.read()
    version = hashlib.blake2b(content, digest_size=16).hexdigest()
    names = set()
    own = module.partition(".")[0]
    for name in imports(module, os.path.basename(path) == "__init__.py", content, version):
        top = name.partition(".")[0]
        kind = "followed" if top in OURS or top == own else _kind(top)
        if kind == "followed" and _file(name):
            names.add(name)
        elif kind == "stamped" and _file(top):
            names.add(f"{top}*")
    return Source(path, version, tuple(names))


@cache
def _reach(module: str) -> frozenset[str]:
    """Return a module, all modules that it imports, and the packages that contain them."""
    reached, ahead = {module}, [module]
    while ahead:
        new = set(_source(ahead.pop()).imports) - reached
        reached |= new
        ahead += new
    # a package's `__init__.py` runs before its modules; its re-exports are not followed
    parts = [name.split(".") for name in reached]
    above = {".".join(p[:n]) for p in parts for n in range(1, len(p))}
    return frozenset(reached | {name for name in above if _file(name)})


@cache
def _all(modules: frozenset[str]) -> frozenset[str]:
    reached: frozenset[str] = frozenset().union(
        *(_reach(m) for m in modules if _kind(m.partition(".")[0]) != "standard")
    )
    return reached


@cache
def _digest(modules: frozenset[str]) -> str:
    lines = sorted(f"{name} {_source(name).digest}" for name in _all(modules))
    return hashlib.blake2b("\n".join(lines).encode(), digest_size=16).hexdigest()


def digest(modules: Iterable[str]) -> str:
    """Return a hexadecimal digest of the sources of modules and of all modules that they import.

    The standard library is not included, and an external package contributes its date only.

    Raises:
        OSError: a module has no source, or the source cannot be read.
        SyntaxError: a source is not Python.
    """
    return _digest(frozenset(modules))


def forget() -> None:
    """Clear the stored digests, after a module was replaced by another one with the same name."""
    for remembered in (_file, _folders, _entries, _kind, _source, _reach, _all, _digest):
        remembered.cache_clear()


def sources_are_current(modules: Iterable[str]) -> bool:
    """Return True if this process executes these sources: no file has changed since it started."""
    try:
        states = [os.stat(path) for name in _all(frozenset(modules)) if (path := _source(name).path)]
    except OSError:
        return False
    # a moved file keeps its modification time (mtime), but gets a new ctime
    return all(max(state.st_mtime, state.st_ctime) < BEGAN for state in states)


def imports(module: str, is_package: bool, source: bytes, version: str) -> list[str]:
    """Return the dotted names that a source imports anywhere: modules, and names that may be modules.

    Parsing the few hundred sources of a run would take half a second, so the result is stored on disk.

    Args:
        module: dotted name of the module, the origin of relative imports.
        is_package: True if the source is an `__init__.py`.
        source: text of the module.
        version: hexadecimal digest of the source.

    Raises:
        SyntaxError: the source is not Python.
    """
    text = cache_files.read("imports", module, version)
    if text is None:
        text = "\n".join(
            sorted(_imported_modules(source, module if is_package else module.rpartition(".")[0]))
        ).encode()
        cache_files.write("imports", module, version, text)
    return text.decode().split()


def _imported_modules(source: bytes, package: str) -> set[str]:
    imports: set[str] = set()
    for node in ast.walk(parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                parts = alias.name.split(".")
                imports.update(".".join(parts[: n + 1]) for n in range(len(parts)))
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            imports.update([base, *(f"{base}.{alias.name}" for alias in node.names if alias.name != "*")])
    return imports
