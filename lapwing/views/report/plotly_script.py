"""The script of plotly.js from its Python package, reduced to the trace types of this project.

The script of the package has about fifty trace types and a map engine, 4.8 MB. It is a sequence of modules,
`var NAME=W((exports,module)=>{...})`, bundled by esbuild; the last one registers the trace types. A page contains the
modules that its trace types refer to, directly or indirectly: 1.2 MB.
"""

import base64
import gzip
import re
from importlib.util import find_spec
from pathlib import Path

from lapwing.cosim.optional_packages import require

TRACES = ("scatter", "bar")  # trace types of `plotly_traces`
_MODULE = re.compile(r"var ([\w$]+)=W\(")  # after one of `_ENDS`; patterns that begin with a text are found fast
_ENDS = ";\n}"
_REGISTER = re.compile(
    r"\.register\(\[((?:[\w$]+\(\),?)+)\]\);[\w$]+\.exports=[\w$]+\}\);(?=return ([\w$]+)\(\);\}\)\(\);)"
)
_KIND = re.compile(r'moduleType:"trace",name:"(\w+)"')
_ALIAS = re.compile(r'var [\w$]+=W\(\([\w$,]+\)=>\{"use strict";[\w$]+\.exports=([\w$]+)\(\)\}\);?')
_INNER = re.compile(r"=(?:Ea\(|\{\};Fp\()")  # after names of modules in ECMAScript style within one in CommonJS style
_NAME = re.compile(r"[\w$]+")
_LAST_NAME = re.compile(r"[\w$]+\Z")


def script() -> str:
    """Return the text of plotly.js from its Python package, without importing it.

    Raises:
        ValueError: the package is not installed.
    """
    require("plotly")
    match = find_spec("plotly")
    for folder in (match.submodule_search_locations or ()) if match else ():
        path = Path(folder) / "package_data" / "plotly.min.js"
        if path.exists():
            return path.read_text(encoding="utf-8")
    raise ValueError("the package plotly has no plotly.js; pip install --force-reinstall plotly")


def remove_unused_traces(text: str) -> str:
    """Return plotly.js with TRACES only; unchanged if it is not bundled as described above."""
    starts = [(m.start(), m[1]) for m in _MODULE.finditer(text) if text[max(m.start() - 1, 0) : m.start()] in _ENDS]
    register = _REGISTER.search(text)
    if not starts or register is None or register[2] != starts[-1][1]:
        return text
    first, last = starts[0][0], register.end()
    ends = [start for start, _ in starts[1:]] + [last]
    bodies = {name: text[start:end] for (start, name), end in zip(starts, ends, strict=True)}
    # The core registers scatter.
    names = [name for name in _NAME.findall(register[1]) if _kind(name, bodies) in TRACES]
    entry = register[2]
    bodies[entry] = bodies[entry].replace(register[1], ",".join(f"{name}()" for name in names))
    owners = {inner: name for name, body in bodies.items() for inner in _inner_names(body)}
    owners |= {name: name for name in bodies}
    needed: set[str] = set()
    pending = [entry]
    while pending:
        name = pending.pop()
        if name not in needed:
            needed.add(name)
            pending += {owners[used] for used in set(_NAME.findall(bodies[name])) if used in owners} - needed
    return text[:first] + "".join(body for name, body in bodies.items() if name in needed) + text[last:]


def _inner_names(body: str) -> list[str]:
    """Return the names of the modules within a module."""
    before = (_LAST_NAME.search(body, max(match.start() - 99, 0), match.start()) for match in _INNER.finditer(body))
    return [match[0] for match in before if match]


def _kind(name: str, bodies: dict[str, str]) -> str:
    """Return the trace type of a registered module or of the module that it is an alias of; "" for all others."""
    if match := _KIND.search(bodies.get(name, "")):
        return match[1]
    alias = _ALIAS.fullmatch(bodies.get(name, ""))
    return _kind(alias[1], bodies) if alias else ""


def gzip_base64(text: str) -> str:
    """Return a text compressed with gzip, in base64."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")
