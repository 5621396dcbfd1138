"""Zenoh session settings, and the time-out of TCP connections."""

import os
import socket
import stat
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

LEASE_MS = 10_000  # after this long without a sign of life a peer counts as gone; the launcher finds out sooner
OPEN_MS = 2_000  # for one attempt to reach a peer; others follow, and closing a session waits for the one under way
LARGEST = 1 << 26  # [bytes] of a message that is put together from fragments; a set-up or a batch has less


def session_settings(listen: Sequence[str], connect: Sequence[str], mode: str, awaits: bool) -> dict[str, Any]:
    """Return entries of the Zenoh configuration by key; see `lapwing.cosim.transport.bus.ZenohBus` for arguments."""
    return {
        "mode": mode,
        "listen/endpoints": listen,
        "connect/endpoints": connect,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 1.5},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "open/return_conditions/connect_scouted": awaits,
        "transport/shared_memory/enabled": False,
        "transport/unicast/open_timeout": OPEN_MS,
        "transport/link/tx/lease": LEASE_MS,
        # as long for one that takes nothing: after a cut of 2 s, TCP may wait for 3 s more before it tries again
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 1000 * LEASE_MS,
        "transport/link/rx/max_message_size": LARGEST,
    }


_LINUX = hasattr(socket, "TCP_USER_TIMEOUT")


def limit_silence(milliseconds: int) -> None:
    """Have the system end each connection that is open now once what it sent is not confirmed for so long.

    Without, it tries for a quarter of an hour (tcp(7), tcp_retries2); Zenoh waits for that where it closes a link over
    TLS that still has something to send, and until then counts its peer as there.
    """
    if not _LINUX:
        return
    for name in os.listdir("/proc/self/fd"):
        with suppress(OSError):  # gone meanwhile, or no TCP
            descriptor = int(name)
            if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                with socket.socket(fileno=os.dup(descriptor)) as result:
                    result.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, milliseconds)
