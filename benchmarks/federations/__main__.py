"""python -m benchmarks.federations."""

from benchmarks._command import command_line
from benchmarks.federations import main

command_line(main)
