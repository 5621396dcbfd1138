"""Real-time scheduling class of the operating system, for runs in real time."""

import os

PRIORITY = 10  # SCHED_FIFO priority: above all ordinary programs, below the threads of the operating system's kernel


def unavailable_reason() -> str:
    """Return the reason why this process cannot use the real-time class; "" if it can."""
    if not hasattr(os, "sched_setscheduler"):
        return "this system has no real-time class"
    policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        os.sched_setscheduler(0, policy, priority)
    except OSError as error:
        reason = str(error.strerror).lower()
        return f"{reason}; it needs the capability CAP_SYS_NICE or a limit RLIMIT_RTPRIO of {PRIORITY}"
    return ""


def enter() -> None:
    """Put all threads of this process into the real-time class.

    Raises:
        OSError: it has no permission (see `unavailable_reason`).
    """
    for thread in os.listdir("/proc/self/task"):
        os.sched_setscheduler(int(thread), os.SCHED_FIFO, os.sched_param(PRIORITY))
