"""Standard input, output and error of the command, also where whoever starts it has closed them."""

import os
import sys

FILES = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))  # by their numbers


def open_closed() -> None:
    """Let those that are closed be the null device: of what is opened next none takes its number."""
    for number, (name, mode) in enumerate(FILES):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:
                os.dup2(null, number)
                os.close(null)
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
