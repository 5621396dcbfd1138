"""Tables by which compiled code finds an implementation from the class of an argument."""

import sys
from collections import UserDict
from typing import Any


class DispatchTable(UserDict[type, Any]):
    """Mapping from a class to a compiled function, or to a NamedTuple of compiled functions.

    A kernel may reach code through such a table that its own module never imports. So the cache looks up every class in
    an argument's type in every table: what is found there is part of what the kernel is made of.
    """

    tables: "dict[str, DispatchTable]" = {}  # noqa: RUF012 (all there are, by the module that made them and a number in it)
    entered = 0  # how often any table was written

    def __init__(self) -> None:
        super().__init__()
        maker = sys._getframe(1).f_globals["__name__"]
        number = sum(name.rpartition(" ")[0] == maker for name in DispatchTable.tables)
        DispatchTable.tables[f"{maker} {number}"] = self

    def __setitem__(self, cls: type, implementation: Any) -> None:
        """Let a class stand for something."""
        DispatchTable.entered += 1
        super().__setitem__(cls, implementation)
