"""User modules: found in the folder of the scene or on Python's path, and stored in the run configuration as text.

Each process of a run, and each resimulation, runs that text: no process searches for the file again, and an
edit during the start of a run has no effect. The text is written to a folder of the cache that is named by its
content, so that tracebacks can show it and its machine code can be cached. A package, or a module in one, is
imported as usual: it must be installed on every machine of the run.
"""

import ast
import atexit
import hashlib
import importlib
import importlib.util
import os
import re
import shutil
import sys
import tempfile
import traceback
import uuid
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

from lapwing.cosim.access.private_sockets import only_user_writable
from lapwing.dynamics.config_error import ConfigError
from lapwing.kernels import cache_folder, forget_sources
from lapwing.syntax_tree import parse


def find(key: str, name: str, folder: Path) -> dict[str, Path]:
    """Return the files of a module and of the neighbouring modules that it imports, without importing them.

    Args:
        key: dotted key of the scene that names it.
        name: name of the module.
        folder: folder of the scene.

    Returns:
        Files by the name of the module; the first is its own.

    Raises:
        ConfigError: the module does not exist, has no source, or has the name of another module.
    """
    if not all(part.isidentifier() for part in name.split(".")):
        raise ConfigError(key, f"got module {name!r}", "a name that Python can import")
    file, installed = (folder / f"{name}.py").resolve(), installed_module(name)
    if file.is_file():
        if _is_taken(name, file):
            raise ConfigError(key, f"{file}: another module has this name", "a unique name")
    elif installed is None:
        raise ConfigError(key, f"no module {name}", f"{file}, or a module on Python's path")
    elif not (installed.origin or "").endswith(".py"):
        raise ConfigError(key, f"module {name} has no source", "a module written in Python")
    else:
        file = Path(str(installed.origin)).resolve()
    result = {name: file}
    ahead = [file] if _is_carried(name, file) else []
    while ahead:
        for imported in _imports(ahead.pop()):
            neighbour = file.parent / f"{imported}.py"
            if imported not in result and neighbour.is_file() and not _is_taken(imported, neighbour):
                result[imported] = neighbour
                ahead.append(neighbour)
    return result


def _is_taken(name: str, file: Path) -> bool:
    """Return True if Python would import another file of that name."""
    installed = installed_module(name)
    other = installed is not None and Path(str(installed.origin)).resolve() != file
    return other or name in sys.stdlib_module_names


def installed_module(name: str) -> ModuleSpec | None:
    """Return the module of that name on `sys.path`, except in the folders that this module has written."""
    if "." not in name:
        return PathFinder.find_spec(name, [path for path in sys.path if not _is_written(path)])
    with suppress(ImportError, ValueError):
        return importlib.util.find_spec(name)
    return None


def _is_carried(name: str, file: Path) -> bool:
    return "." not in name and file.name != "__init__.py"


def _imports(file: Path) -> list[str]:
    """Return the sorted top-level names that a source imports; an empty list if it is not Python."""
    result: set[str] = set()
    with suppress(SyntaxError, ValueError, OSError):
        for node in ast.walk(parse(file.read_bytes())):
            if isinstance(node, ast.Import):
                result.update(alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                result.add(node.module.partition(".")[0])
    return sorted(result)


FAULTS = (Exception, SystemExit)  # errors of user code that end a run with one line
_PREFIX = "run-modules-"  # of the folders with modules of run configurations; spawned workers inherit `sys.path`


def _is_written(folder: str) -> bool:
    return Path(folder).name.startswith(_PREFIX)


def load(name: str, texts: Mapping[str, str]) -> ModuleType:
    """Return the module of that name, imported from its text unless the same text was imported before.

    Args:
        name: name of the module.
        texts: sources of all modules in the run configuration, by name.

    Raises:
        Exception: any error of the module; ImportError if it needs a module that is missing.
    """
    install(texts)
    return importlib.import_module(name)


def install(texts: Mapping[str, str]) -> None:
    """Make the modules of a run configuration importable, and unload modules of the same name with other sources."""
    plain = {n: text for n, text in texts.items() if "." not in n}
    stale = [n for n in plain if n in sys.modules and source(sys.modules[n]) not in (None, plain[n])]
    for n in plain if stale else ():
        sys.modules.pop(n, None)  # including modules that import a stale one
    if stale:
        forget_sources()
    if any(n not in sys.modules for n in plain):
        folder = _write_modules(plain)
        sys.path[:] = [*(path for path in sys.path if not _is_written(path)), folder]
        importlib.invalidate_caches()


def source(module: ModuleType) -> str | None:
    """Return the source of a module; None for a package."""
    file = Path(getattr(module, "__file__", None) or "__init__.py")
    with suppress(OSError, UnicodeDecodeError):
        return None if file.name == "__init__.py" else file.read_text(encoding="utf-8")
    return ""


def _write_modules(texts: Mapping[str, str]) -> str:
    """Write these modules into a folder of the cache, or of this process if other users can write there."""
    digest = hashlib.blake2b("\0".join(f"{n}\0{texts[n]}" for n in sorted(texts)).encode(), digest_size=16).hexdigest()
    cache_root, name = cache_folder(), f"{_PREFIX}{digest}"
    if cache_root is not None:
        folder = cache_root / "modules" / name
        with suppress(OSError):
            for path in (cache_root, folder.parent, folder):
                path.mkdir(mode=0o700, parents=True, exist_ok=True)  # its files are executed
            if all(map(only_user_writable, (cache_root, folder.parent, folder))):
                _write(folder, texts)
                return str(folder)
    folder = _folder_of_this_process() / name
    folder.mkdir(exist_ok=True)
    _write(folder, texts)
    return str(folder)


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    """Write the modules whose files are missing or different."""
    for name, text in texts.items():
        file, content = folder / f"{name}.py", text.encode()
        if not file.exists() or not only_user_writable(file) or file.read_bytes() != content:
            temporary = folder / f"{name}.{uuid.uuid4().hex}"
            with open(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as out:
                out.write(content)
            temporary.replace(file)


@cache
def _folder_of_this_process() -> Path:
    """Create a folder that is removed at the exit of this process; its forks may use it."""
    folder, maker = tempfile.mkdtemp(prefix="lapwing-"), os.getpid()

    @atexit.register
    def remove() -> None:
        if os.getpid() == maker:
            shutil.rmtree(folder, ignore_errors=True)

    return Path(folder)


def blame(error: BaseException, module: ModuleType) -> str:
    """Return the message of an exception, with the last line of the module in its traceback or compile error."""
    text = _COLOUR.sub("", str(error)).strip()
    file = getattr(module, "__file__", None)  # None for code of an interactive prompt
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == file]
    where = f" ({Path(str(file)).name}, line {lines[-1]})" if lines else ""
    message = text.partition("\n")[0]
    if found := _SOURCE_LINE.search(text):
        message, where = _compiler_message(text[: found.start()]), f" ({Path(found[1]).name}, line {found[2]})"
    return f"{type(error).__name__}{': ' if message else ''}{message}{where}"


# numba colours its messages where the package colorama is installed
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_SOURCE_LINE = re.compile(r'^ *File "([^"]+)", line (\d+)', re.MULTILINE)  # in a message of numba's compiler
_CONTEXT = ("Failed in", "During:", "raised from", "With argument", "Rejected", "- Of which", "Overload", ">>>")


def _compiler_message(text: str) -> str:
    """Return the innermost cause in a message of numba's compiler, which lists the callers' failures first."""
    lines = [line.strip() for line in text.splitlines()]
    causes = [line for line in lines if line and not line.startswith(_CONTEXT)]
    return causes[-1].removeprefix("TypingError: ") if causes else lines[0]
