"""Stop of a scripted firmware, as by a debugger."""

import os
import signal
import subprocess


def stop_for(seconds):
    """Stop this process; another one lets it continue."""
    subprocess.Popen(["sh", "-c", f"sleep {seconds}; kill -CONT {os.getpid()}"], start_new_session=True)
    os.kill(os.getpid(), signal.SIGSTOP)
