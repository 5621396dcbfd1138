"""Somebody in the containers' network who tries to read a flight and to command it; says what he is let do.

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
FORGED = b"forged"
WRONG = (
    (OPERATOR_KEY, MAVLINK),
    (STEP_KEY, "autopilot"),
    (STEP_KEY, "plant"),
    (DIVERGED_KEY, "plant"),
    (ENDED_KEY, "plant"),
)


def presented(endpoint: str, name: str) -> str:
    """The name in the certificate of whoever listens at an endpoint, who is shown that of `name`."""
    host, _, port = endpoint.partition("/")[2].partition(":")
    context = ssl.create_default_context(cafile=str(KEYS / name / AUTHORITY))
    context.check_hostname = False
    context.load_cert_chain(KEYS / name / CERTIFICATE, KEYS / name / KEY)
    with socket.create_connection((host, int(port))) as opened, context.wrap_socket(opened) as link:
        return dict(entry for (entry, *_) in link.getpeercert()["subject"])["commonName"]


def intrude(endpoint: str, name: str) -> str:
    """What is read there; puts messages that others are to take for the run's."""
    try:
        bus = ZenohBus(connect=[endpoint], mode="client", security=tls(KEYS, name) if name != "nobody" else {})
    except BusError:
        return "refused"
    with bus:
        topics, steps = (bus.subscribe(f"{RUN.key_prefix}/{key}/*") for key in ("drone1", STEP_KEY))
        read = ["topics"] if topics.get(timeout=10.0) else []
        read += ["lock step"] if steps.get(timeout=2.0) else []
        for _ in range(10):
            for key, author in WRONG:
                bus.publisher(f"{RUN.key_prefix}/{key}/{author}", gid=RUN.gid(author))(FORGED, 0)
            time.sleep(0.05)
    return " and ".join(read) or "nothing"


def main(name: str, *endpoints: str) -> None:
    """Try all endpoints at once; one line for each."""
    with ThreadPoolExecutor(len(endpoints)) as tries:
        for endpoint, read in zip(endpoints, tries.map(lambda each: intrude(each, name), endpoints), strict=True):
            who = f" of {presented(endpoint, name)}" if name != "nobody" else ""
            print(f"{endpoint}{who}: {read}")


if __name__ == "__main__":
    main(*sys.argv[1:])
