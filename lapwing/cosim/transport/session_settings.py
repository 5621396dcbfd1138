"""Zenoh session settings: entries of the configuration, links of a mesh, runtime threads, TCP time-outs."""

import os
import socket
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

LEASE_MS = 10_000  # [ms] without a message after which a peer counts as lost; the launcher detects it earlier
OPEN_MS = 2_000  # [ms] for one attempt to reach a peer; closing a session waits for the current attempt
LARGEST = 1 << 26  # [bytes] limit of a fragmented message; run configurations and log packets are smaller

# One runtime thread instead of six: the largest single gain in latency (see docs/reference/benchmarks.md).
_RUNTIME = "(rx:(handover:app),acc:(handover:app),tx:(handover:app),net:(handover:app),app:(worker_threads:1))"


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
        # also for a peer that accepts no data: after an interruption of 2 s, TCP may wait 3 s more before it retries
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 1000 * LEASE_MS,
        "transport/link/rx/max_message_size": LARGEST,
    }


CHILD_LINKS = {
    "transport/unicast/open_timeout": 600_000,  # [ms]
    "transport/unicast/accept_timeout": 600_000,  # [ms]
    "transport/link/tx/lease": 600_000,  # [ms]
    "transport/link/tx/queue/congestion_control/block/wait_before_close": 600_000_000,  # [us]
}
"""Settings of the processes of one launcher.

The launcher detects stalled processes and measures how long they waited for a CPU. Zenoh measures wall time only:
messages are lost when it closes a link, and a link that is not open in time may send but never receive.
"""

_LINUX = hasattr(socket, "TCP_USER_TIMEOUT")


def limit_silence(milliseconds: int) -> None:
    """Set the TCP time-out for unacknowledged data of all connections that are open now.

    Without it, the system retries for a quarter of an hour (tcp(7), tcp_retries2). Zenoh waits for that when it closes
    a TLS link with unsent data, and counts the peer as present until then.
    """
    if not _LINUX:
        return
    for name in os.listdir("/proc/self/fd"):
        with suppress(OSError):  # closed since the listing, or not TCP
            descriptor = int(name)
            if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                with socket.socket(fileno=os.dup(descriptor)) as result:
                    result.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, milliseconds)


@contextmanager
def one_runtime_thread() -> Iterator[None]:
    """Set ZENOH_RUNTIME, which Zenoh reads when it opens a session; programs started later do not inherit it."""
    if "ZENOH_RUNTIME" in os.environ:
        yield
        return
    os.environ["ZENOH_RUNTIME"] = _RUNTIME
    try:
        yield
    finally:
        os.environ.pop("ZENOH_RUNTIME", None)


def mesh(name: str, endpoints: Mapping[str, str]) -> tuple[list[str], list[str]]:
    """Return the endpoints on which participant `name` listens and to which it connects: each pair is linked once.

    It does not depend on the order of `endpoints`, which need not be the same for all of them.
    """
    names = sorted(endpoints)
    return [endpoints[name]], [endpoints[other] for other in names[: names.index(name)]]
