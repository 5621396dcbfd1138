"""Tables that map the class of an argument to its implementation in compiled code."""

import sys
from collections import UserDict
from collections.abc import Mapping
from typing import Any


class DispatchTable(UserDict[type, Any]):
    """Mapping from a class to a compiled function, or to a NamedTuple of compiled functions.

    A class without an entry is mapped to what its module calls `name`, if the table has a name.

    A kernel can reach code through such a table that its own module never imports. Therefore the cache looks up every
    class of an argument's type in every table, and the entries become part of the kernel's key.
    """

    tables: "dict[str, DispatchTable]" = {}  # noqa: RUF012 (all tables, by the module that created them and a number in it)
    entered = 0  # number of writes to all tables

    def __init__(self, name: str = "") -> None:
        super().__init__()
        self._name = name
        maker = sys._getframe(1).f_globals["__name__"]
        number = sum(name.rpartition(" ")[0] == maker for name in DispatchTable.tables)
        DispatchTable.tables[f"{maker} {number}"] = self

    def __setitem__(self, cls: type, implementation: Any) -> None:
        """Register the implementation of a class."""
        DispatchTable.entered += 1
        super().__setitem__(cls, implementation)

    def __missing__(self, cls: type) -> Any:
        """Return the implementation in the module of a class. Raise KeyError if there is none."""
        try:
            return getattr(sys.modules[cls.__module__], self._name)
        except AttributeError:
            raise KeyError(f"{cls.__module__} has no {self._name}") from None

    get = Mapping.get  # type: ignore[assignment]  # that of UserDict ignores `__missing__` from Python 3.12 on
