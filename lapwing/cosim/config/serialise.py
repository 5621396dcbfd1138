"""Exact conversion of trees of values to canonical JSON and back: equal trees lead to equal text on every machine.

Dicts and lists are JSON objects and arrays. Other values are objects with the key "$", their type:

    {"$": "tuple", "of": [...]}
    {"$": "float", "of": "inf"}                             inf, -inf, nan
    {"$": "scalar", "dtype": "uint64", "of": 3}             numpy scalar
    {"$": "array", "dtype": "float64", "shape": [2], "of": [0.5, 1.0]}
    {"$": "dict", "of": {...}}                              dict with the key "$"
    {"$": "lapwing.dynamics.effects.gravity:Gravity", "acceleration": 9.80665}      a NamedTuple or frozen dataclass
"""

import dataclasses
import hashlib
import importlib
import json
import math
import sys
import zlib
from collections.abc import Collection
from typing import Any

import numpy as np

TAG = "$"
LARGEST = 1 << 26  # [bytes] limit of the text of a run configuration; typical ones have up to a few million
DTYPES = ("bool", "float64", "int64")  # types of arrays
SCALARS = ("bool", "float64", "int64", "uint64")


def to_json(tree: Any) -> str:
    """Return the canonical text of a tree: sorted keys, no spaces, floats in Python's `repr` format.

    Args:
        tree: NamedTuples, frozen dataclasses, tuples, lists, dicts with texts as keys, str, bool, int, float, None,
            numpy arrays of float64, int64 and bool, numpy scalars.

    Raises:
        ValueError: a value of another type, or a class that cannot be imported by its name; names its path.
    """
    return json.dumps(_encode(tree, ""), sort_keys=True, separators=(",", ":"), allow_nan=False)


def from_json(text: str, modules: Collection[str] = ()) -> Any:
    """Return the tree of a text of `to_json`.

    Args:
        text: may be untrusted: only this package and `modules` are imported for it.
        modules: further modules whose classes the text may name.

    Raises:
        ValueError: not JSON, an unknown tag, or a class that is missing, not declared, or has other fields now.
    """
    try:
        return _decode(json.loads(text), modules)
    except RecursionError:
        raise ValueError("not a tree of values: nested too deeply") from None


def compress(tree: Any) -> bytes:
    """Return the canonical text of a tree as a message that needs no fragments."""
    return zlib.compress(to_json(tree).encode())


def decompress(message: bytes) -> str:
    """Return the text of a message; external services may send it uncompressed.

    Raises:
        ValueError: not a text, or larger than `LARGEST`.
    """
    if message.startswith(b"{"):
        return message.decode()
    decompressor = zlib.decompressobj()
    try:
        text = decompressor.decompress(message, LARGEST)
    except zlib.error as error:
        raise ValueError(f"not a compressed text: {error}") from None
    if not decompressor.eof:
        raise ValueError(f"compressed text is incomplete, or larger than {LARGEST} bytes")
    return text.decode()


def digest(tree: Any) -> str:
    """Return the BLAKE2b digest of the canonical text, hexadecimal."""
    return hashlib.blake2b(to_json(tree).encode(), digest_size=16).hexdigest()


class Absent:
    """Placeholder for a value that only one of two trees has."""

    def __repr__(self) -> str:
        return "nothing"


ABSENT = Absent()
OWN = ("lapwing",)  # packages whose modules a text may import


def first_difference(a: Any, b: Any) -> tuple[str, Any, Any] | None:
    """Return the first difference of two trees: (dotted path, value in `a`, value in `b`); None if they are identical.

    A missing value is `ABSENT`.
    """
    return _difference(a, b, "")


def _difference(a: Any, b: Any, path: str) -> tuple[str, Any, Any] | None:
    children_a, children_b = _children(a), _children(b)
    if type(a) is not type(b) or children_a is None or children_b is None:
        same = a is not ABSENT and b is not ABSENT and to_json(a) == to_json(b)
        return None if same else (path, a, b)
    for key in dict.fromkeys([*children_a, *children_b]):
        inner = f"{path}.{key}" if path else str(key)
        result = _difference(children_a.get(key, ABSENT), children_b.get(key, ABSENT), inner)
        if result:
            return result
    return None


def _children(value: Any) -> dict[Any, Any] | None:
    """Return the members of a tree's node by name or index; None for a leaf."""
    if isinstance(value, dict):
        return dict(sorted(value.items()))
    if _is_record(type(value)):
        return {name: getattr(value, name) for name in _fields(type(value))}
    if isinstance(value, tuple | list):
        return dict(enumerate(value))
    if isinstance(value, np.ndarray) and value.ndim:
        return {"dtype": value.dtype.name, "shape": value.shape, **dict(enumerate(value))}
    return None


def _encode(value: Any, path: str) -> Any:
    kind = type(value)
    if value is None or kind in (bool, int, str):
        return value
    if kind is float:
        return value if math.isfinite(value) else {TAG: "float", "of": repr(value)}
    if kind is list:
        return [_encode(item, f"{path}.{i}") for i, item in enumerate(value)]
    if kind is tuple:
        return {TAG: "tuple", "of": [_encode(item, f"{path}.{i}") for i, item in enumerate(value)]}
    if kind is dict:
        for key in value:
            if type(key) is not str:
                raise ValueError(f"{path or 'tree'}: key {key!r}: expected a text")
        inner = {key: _encode(item, f"{path}.{key}") for key, item in value.items()}
        return {TAG: "dict", "of": inner} if TAG in value else inner
    if _is_record(kind):
        return {TAG: _name_of(kind), **{f: _encode(getattr(value, f), f"{path}.{f}") for f in _fields(kind)}}
    if isinstance(value, np.ndarray) and value.dtype.name in DTYPES:
        flat = [_encode(item, path) for item in value.ravel().tolist()]
        return {TAG: "array", "dtype": value.dtype.name, "shape": list(value.shape), "of": flat}
    if isinstance(value, np.generic) and value.dtype.name in SCALARS:
        return {TAG: "scalar", "dtype": value.dtype.name, "of": _encode(value.item(), path)}
    raise ValueError(f"{path.lstrip('.') or 'tree'}: a {kind.__module__}.{kind.__qualname__} cannot be serialised")


def _decode(value: Any, modules: Collection[str]) -> Any:
    if isinstance(value, list):
        return [_decode(item, modules) for item in value]
    if not isinstance(value, dict):
        return value
    if TAG not in value:
        return {key: _decode(item, modules) for key, item in value.items()}
    tag = value[TAG]
    try:
        if tag == "float":
            return float(value["of"])
        if tag == "tuple":
            return tuple(_decode(item, modules) for item in value["of"])
        if tag == "dict":
            return {key: _decode(item, modules) for key, item in value["of"].items()}
        if tag == "scalar":
            return np.dtype(_allowed_dtype(value["dtype"], SCALARS)).type(_decode(value["of"], modules))
        if tag == "array":
            flat = [_decode(item, modules) for item in value["of"]]
            return np.array(flat, dtype=_allowed_dtype(value["dtype"], DTYPES)).reshape(value["shape"])
    except (KeyError, TypeError, OverflowError) as error:
        raise ValueError(f"damaged {tag!r}: {error!r}") from None
    members = {key: _decode(item, modules) for key, item in value.items() if key != TAG}
    return _record(_class_of(str(tag), modules), str(tag), members)


def _allowed_dtype(dtype: Any, allowed: Collection[str]) -> str:
    """Return the name of an allowed type: another, such as a text of 10^9 characters, could exhaust the memory."""
    if not isinstance(dtype, str) or dtype not in allowed:
        raise TypeError(f"dtype {dtype!r}; expected one of {', '.join(allowed)}")
    return dtype


def _record(cls: type, name: str, members: dict[str, Any]) -> Any:
    if set(members) != set(_fields(cls)):
        raise ValueError(f"{name}: has the fields {', '.join(_fields(cls))}, got {', '.join(members)}")
    return cls(**members)


def _is_record(cls: type) -> bool:
    """Return True for a NamedTuple or a frozen dataclass."""
    if issubclass(cls, tuple):
        return hasattr(cls, "_fields")
    return dataclasses.is_dataclass(cls) and cls.__dataclass_params__.frozen  # type: ignore[attr-defined]


def _fields(cls: type) -> tuple[str, ...]:
    return cls._fields if hasattr(cls, "_fields") else tuple(f.name for f in dataclasses.fields(cls))  # type: ignore


def _name_of(cls: type) -> str:
    name = f"{cls.__module__}:{cls.__qualname__}"
    if _class_of(name, [cls.__module__]) is not cls:
        raise ValueError(f"{name}: is another class of the same name; it cannot be serialised")
    return name


def _class_of(name: str, modules: Collection[str]) -> type:
    module, _, path = name.partition(":")
    if module.partition(".")[0] not in OWN and module not in sys.modules and module not in modules:
        raise ValueError(f"{name}: no such class; expected one of {', '.join(OWN)} or of a declared module")
    try:
        result: Any = importlib.import_module(module)
        for part in path.split("."):
            result = getattr(result, part)
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{name}: no such class can be imported ({error})") from None
    if not (isinstance(result, type) and _is_record(result)):
        raise ValueError(f"{name}: expected a NamedTuple or a frozen dataclass")
    return result
