"""python -m benchmarks.other_simulators [CASE...]."""

import sys

from benchmarks.other_simulators import main

main(tuple(sys.argv[1:]))
