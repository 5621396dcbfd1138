"""Imports in the source of a module, found without executing it."""

import ast

from lapwing.kernels.compiler import cache_files


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
        text = "\n".join(sorted(_parsed(source, module if is_package else module.rpartition(".")[0]))).encode()
        cache_files.write("imports", module, version, text)
    return text.decode().split()


def _parsed(source: bytes, package: str) -> set[str]:
    imports: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                parts = alias.name.split(".")
                imports.update(".".join(parts[: n + 1]) for n in range(len(parts)))
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            imports.update([base, *(f"{base}.{alias.name}" for alias in node.names if alias.name != "*")])
    return imports
