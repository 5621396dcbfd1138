"""Intruder in the containers' network: tries to read and command a flight, and prints which data it could read.

Used by docker_test.sh:  python - CERTIFICATE|nobody ENDPOINT... < intruder.py
"""

import socket
import ssl
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from lapwing.cosim.access.certificates import AUTHORITY, CERTIFICATE, KEY, tls
from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.run_errors import BusError
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import DIVERGED_KEY, ENDED_KEY, STEP_KEY
from lapwing.services.common.operator_inbox import OPERATOR_KEY
from lapwing.services.process_table import MAVLINK

RUN, KEYS = PublisherIds("lapwing"), Path("keys")
PAYLOAD = b"forged"
TARGETS = (  # key and sender of each forged message
    (OPERATOR_KEY, MAVLINK),
    (STEP_KEY, "autopilot"),
    (STEP_KEY, "plant"),
    (DIVERGED_KEY, "plant"),
    (ENDED_KEY, "plant"),
)


def peer_name(endpoint: str, name: str) -> str:
    """Return the name in the certificate of an endpoint, to which the certificate of `name` is presented."""
    host, _, port = endpoint.partition("/")[2].partition(":")
    context = ssl.create_default_context(cafile=str(KEYS / name / AUTHORITY))
    context.check_hostname = False
    context.load_cert_chain(KEYS / name / CERTIFICATE, KEYS / name / KEY)
    with socket.create_connection((host, int(port))) as connection, context.wrap_socket(connection) as link:
        return dict(entry for (entry, *_) in link.getpeercert()["subject"])["commonName"]


def intrude(endpoint: str, name: str) -> str:
    """Publish forged messages at an endpoint. Return a description of the data that could be read."""
    try:
        bus = ZenohBus(connect=[endpoint], mode="client", security=tls(KEYS, name) if name != "nobody" else {})
    except BusError:
        return "refused"
    with bus:
        topics, steps = (bus.subscribe(f"{RUN.key_prefix}/{key}/*") for key in ("drone1", STEP_KEY))
        read = ["topics"] if topics.get(timeout=10.0) else []
        read += ["lock step"] if steps.get(timeout=2.0) else []
        for _ in range(10):
            for key, sender in TARGETS:
                bus.publisher(f"{RUN.key_prefix}/{key}/{sender}", gid=RUN.gid(sender))(PAYLOAD, 0)
            time.sleep(0.05)
    return " and ".join(read) or "nothing"


def main(name: str, *endpoints: str) -> None:
    """Try all endpoints in parallel, and print a line for each."""
    with ThreadPoolExecutor(len(endpoints)) as pool:
        for endpoint, read in zip(endpoints, pool.map(lambda each: intrude(each, name), endpoints), strict=True):
            peer = f" of {peer_name(endpoint, name)}" if name != "nobody" else ""
            print(f"{endpoint}{peer}: {read}")


if __name__ == "__main__":
    main(*sys.argv[1:])
