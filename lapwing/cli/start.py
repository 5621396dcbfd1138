"""The command `lapwing` from its first moment on: it answers Ctrl-C before it has imported the rest."""

import signal
import sys

from cosim.interrupt import Interrupted, end_at_once


def main() -> None:
    """Entry point of `lapwing`."""
    end_at_once()
    try:
        from lapwing.cli.main import main as carry_out

        carry_out()
    except Interrupted as interrupted:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        print(f"lapwing: {interrupted}", file=sys.stderr)
        raise SystemExit(128 + interrupted.signal) from None
