"""Imports in the source of a module, found without running it."""

import ast

from lapwing.kernels.compiler import cache_files


def imports(module: str, is_package: bool, source: bytes, version: str) -> list[str]:
    """Dotted names that a source imports, anywhere in it: modules, and what may be modules or names in them.

    To parse the few hundred sources of a run would take half a second, so the result is kept on disk.

    Args:
        module: its dotted name, from which relative imports start.
        is_package: whether the source is an `__init__.py`.
        source: its text.
        version: hexadecimal digest of the source.

    Raises:
        SyntaxError: the source is not Python.
    """
    kept = cache_files.read("imports", module, version)
    if kept is None:
        kept = "\n".join(sorted(_parsed(source, module if is_package else module.rpartition(".")[0]))).encode()
        cache_files.write("imports", module, version, kept)
    return kept.decode().split()


def _parsed(source: bytes, package: str) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                parts = alias.name.split(".")
                found.update(".".join(parts[: n + 1]) for n in range(len(parts)))
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            found.update([base, *(f"{base}.{alias.name}" for alias in node.names if alias.name != "*")])
    return found
