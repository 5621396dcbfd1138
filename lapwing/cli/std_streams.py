"""Standard input, output and error: replaced if closed, and able to print every character."""

import io
import os
import sys

FILES = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))  # by their numbers


def prepare_streams() -> None:
    """Open the null device for closed streams, and escape characters that the encoding of an output lacks."""
    for number, (name, mode) in enumerate(FILES):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:
                os.dup2(null, number)
                os.close(null)
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")
