"""A process exits without garbage collection, but with its exit handlers."""

import subprocess
import sys

import pytest

END = """
import atexit
from lapwing.cosim.processes import relax_gc

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
def test_relaxed_process_skips_collection_at_exit(call, output):
    ended = subprocess.run([sys.executable, "-c", END.format(call=call)], capture_output=True, text=True, check=True)
    assert ended.stdout.splitlines() == output
