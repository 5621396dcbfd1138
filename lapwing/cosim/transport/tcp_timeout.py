"""How long this process's TCP connections wait for a host that confirms nothing any more."""

import os
import socket
import stat
from contextlib import suppress

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
                with socket.socket(fileno=os.dup(descriptor)) as found:
                    found.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, milliseconds)
