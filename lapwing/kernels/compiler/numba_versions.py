"""Versions of numba and llvmlite for which the compile pipeline of this package is known to work."""

import os
import re
import sys

import llvmlite
import numba

NUMBA = (0, 63), (0, 68)  # oldest and newest minor version, both included
LLVMLITE = (0, 46), (0, 50)
_REPORTED = "LAPWING_NUMBA_REPORTED"  # set for child processes, so that a run prints the line once


def _is_within(version: str, oldest: tuple[int, int], newest: tuple[int, int]) -> bool:
    """Return True if a version text such as "0.68.1" has a minor version in the range."""
    match = re.match(r"(\d+)\.(\d+)", version)
    return match is not None and oldest <= (int(match[1]), int(match[2])) <= newest


def is_supported() -> bool:
    """Return True if the installed numba and llvmlite are known to work with the pipeline.

    For other versions, print one line to the standard error stream, once per run.
    """
    if _is_within(numba.__version__, *NUMBA) and _is_within(llvmlite.__version__, *LLVMLITE):
        return True
    if _REPORTED not in os.environ:
        os.environ[_REPORTED] = "1"
        oldest, newest = (f"{major}.{minor}" for major, minor in NUMBA)
        print(
            f"lapwing: numba {numba.__version__} with llvmlite {llvmlite.__version__} is not tested: kernels compile "
            f"with numba's own passes, more slowly, with equal results; install numba {oldest} to {newest}",
            file=sys.stderr,
        )
    return False
