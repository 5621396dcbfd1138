"""Permission to run machine code that is not Lapwing's own, such as that of FMUs.

It is granted in Python programs. The command line withdraws it unless `--allow-code` is set.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lapwing.cosim.config.run_config import RunConfig

FMU_SUFFIX = "_fmu"  # suffix of the names of FMU services
_allowed = [True]


@contextmanager
def permission(granted: bool) -> Iterator[None]:
    """Grant or withdraw the permission in this process and in those that it forks, until the end of the context."""
    before, _allowed[0] = _allowed[0], granted
    try:
        yield
    finally:
        _allowed[0] = before


def check(config: "RunConfig") -> None:
    """Raise ValueError if a run has FMUs and foreign code is not allowed."""
    names = [f"services.{name.removesuffix(FMU_SUFFIX)}" for name in config.services if name.endswith(FMU_SUFFIX)]
    if names and not _allowed[0]:
        raise ValueError(
            f"{', '.join(names)}: an FMU contains machine code; if you trust its author, use --allow-code to run it"
        )
