"""python -m benchmarks.accuracy."""

from benchmarks._command import command_line
from benchmarks.accuracy import main

command_line(main)
