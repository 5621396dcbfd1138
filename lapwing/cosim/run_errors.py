"""Errors of a run, and the exit codes and signal between a launcher and its processes.

Imports only the standard library, so that the command line knows the errors before it loads the rest.
"""

import signal
from enum import IntEnum

END_SIGNAL = signal.SIGHUP  # launcher's request to end; SIGTERM has other senders, and the error names its receiver


class ExitCode(IntEnum):
    """Exit code of a participant's process."""

    COMPLETED = 0  # the run is complete
    FAILED = 1
    REJECTED = 2  # invalid configuration
    DIVERGED = 3
    CUT_SHORT = 4  # another participant ended before the run did
    TERMINATED = 128 + signal.SIGTERM


class BusError(RuntimeError):
    """The bus could not be opened."""


class RunFailed(RuntimeError):
    """The run did not reach its end; the text names the process at fault."""


class LockStepError(RuntimeError):
    """The lock step cannot continue; the text names the waiting process and the missing data."""

    EXIT_CODE = ExitCode.FAILED


class DivergedError(LockStepError):
    """A state is invalid: non-finite, or outside the range of its coordinates."""

    EXIT_CODE = ExitCode.DIVERGED


class CutShortError(LockStepError):
    """Another participant ended before the run did; the text names it."""

    EXIT_CODE = ExitCode.CUT_SHORT
