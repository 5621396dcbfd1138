"""Expected reproducibility of a log's digest: versions and processor of the recording and of this machine.

Kernels and resolvers use Lapwing's elementary functions in double precision, so results do not depend on C library,
processor, and versions of numba, llvmlite and numpy (`make portability`, `make compatibility`). They depend on
Lapwing's source and on the user's modules.
"""

from collections.abc import Mapping
from typing import NamedTuple

from lapwing.cosim.config.provenance import MACHINE, machine, source_commit

UNKNOWN = "unknown"


class Fact(NamedTuple):
    """Property of the machine that recorded a log, and of this machine."""

    name: str
    recorded: str
    here: str


def facts(metadata: Mapping[str, str]) -> list[Fact]:
    """Return the properties in a log's metadata with those of this machine."""
    here = {"commit": source_commit(), **machine()}
    return [Fact(name, metadata.get(name, UNKNOWN), here[name]) for name in ("commit", *MACHINE)]


def expectation(metadata: Mapping[str, str]) -> str:
    """Return a sentence on the expected result of resimulation on this machine."""
    if metadata.get("mode") == "imported":
        return "imported from another program: resimulation is not possible"
    recorded, here = metadata.get("commit", UNKNOWN), source_commit()
    if UNKNOWN in (recorded, here):
        return "unknown: one of the two commits of Lapwing is not known; resimulate the log"
    if recorded.endswith("+") or here.endswith("+"):
        return "unknown: Lapwing's source had uncommitted changes; resimulate the log"
    if recorded != here:
        return f"not certain: recorded by another commit of Lapwing; check out {recorded}, or resimulate the log"
    return "equal: same commit of Lapwing; processor, C library and packages do not change bits"
