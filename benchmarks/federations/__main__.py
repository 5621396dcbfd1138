import sys

from benchmarks.federations import main

main(*[int(a) for a in sys.argv[1:]])
