"""A process ends without looking for garbage; what it has registered for its end still runs."""

import subprocess
import sys

import pytest

END = """
import atexit
from lapwing.cosim.processes.gc_tuning import relax_gc

class Ring:
    def __init__(self):
        self.itself = self
    def __del__(self):
        print("collected")

{call}
atexit.register(print, "at exit")
ring = Ring()
"""


@pytest.mark.parametrize(("call", "output"), [("", ["at exit", "collected"]), ("relax_gc()", ["at exit"])])
def test_rings_are_left(call, output):
    ended = subprocess.run([sys.executable, "-c", END.format(call=call)], capture_output=True, text=True, check=True)
    assert ended.stdout.splitlines() == output
