"""Measurements of Lapwing and of other simulators: `python -m benchmarks.NAME --help` shows what each one measures."""

import ast
import sys
from pathlib import Path


def _show_help() -> None:
    """Print the description of the benchmark that Python is about to run, and exit, if `--help` is requested.

    This runs before the benchmark is imported, so that its help needs none of its packages. Benchmarks with a parser of
    their own print their own help.
    """
    if sys.argv[0] != "-m" or not {"-h", "--help"} & set(sys.argv[1:]):
        return
    name = sys.orig_argv[-len(sys.argv)].removeprefix("-m")
    path = Path(__file__).parent.parent.joinpath(*name.split(".")).with_suffix(".py")
    if not name.startswith("benchmarks.") or not path.is_file():
        return
    source = path.read_text(encoding="utf-8")
    if "ArgumentParser" not in source:
        print(ast.get_docstring(ast.parse(source)))
        sys.exit()


_show_help()
