"""python -m benchmarks.other_simulators."""

from benchmarks._command import command_line
from benchmarks.other_simulators import main

command_line(main)
