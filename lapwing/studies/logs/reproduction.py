"""Expected reproducibility of a log's digest: versions and processor of the recording and of this machine.

Kernels and resolvers use Lapwing's own elementary functions in plain double arithmetic, so that C library, processor
and the versions of numba, llvmlite and numpy do not change bits (`make portability`, `make compatibility`). Lapwing's
own source and modules of the user do.
"""

from collections.abc import Mapping
from typing import NamedTuple

from lapwing.cosim.config.provenance import MACHINE, machine, source_commit

UNKNOWN = "unknown"


class Fact(NamedTuple):
    """One property of the machine that recorded a log, and of this one."""

    name: str
    recorded: str
    here: str


def facts(metadata: Mapping[str, str]) -> list[Fact]:
    """Compare a log's metadata with this machine."""
    here = {"commit": source_commit(), **machine()}
    return [Fact(name, metadata.get(name, UNKNOWN), here[name]) for name in ("commit", *MACHINE)]


def expectation(metadata: Mapping[str, str]) -> str:
    """Return one sentence on whether resimulation is expected to reproduce the recorded digest here."""
    if metadata.get("mode") == "imported":
        return "imported from another program: there is nothing to resimulate"
    recorded, here = metadata.get("commit", UNKNOWN), source_commit()
    if UNKNOWN in (recorded, here):
        return "unknown: one of the two commits of Lapwing is not known; resimulate the log"
    if recorded.endswith("+") or here.endswith("+"):
        return "unknown: Lapwing's source had uncommitted changes; resimulate the log"
    if recorded != here:
        return f"not certain: recorded by another commit of Lapwing; check out {recorded}, or resimulate the log"
    return "equal: same commit of Lapwing; processor, C library and packages do not change bits"
