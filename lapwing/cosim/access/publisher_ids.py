"""Publisher GIDs: each participant of a run accepts messages only with the GID of their sender.

The GID is the publisher's identifier in the attachment. A run on one machine derives GIDs from a secret that its
launcher draws and writes to the standard input of each process. Participants that are started separately share no
secret: there a GID only distinguishes runs, and certificates authenticate the senders (docs/explanation/security.md).
"""

import hashlib
import secrets
from collections.abc import Collection, Iterable
from typing import NamedTuple

from lapwing.cosim.transport.bus_keys import BATCH_KEY, ENCODER


def new_secret() -> str:
    """Return a secret for one run, 64 hexadecimal digits, from which its participants derive their GIDs."""
    return secrets.token_hex(32)


class PublisherIds(NamedTuple):
    """GIDs of the participants of one run."""

    key_prefix: str
    secret: str = ""  # hexadecimal; "" without a shared secret
    external: Collection[str] = ()  # names of external services, which choose their own GIDs

    def gid(self, name: str) -> bytes:
        """Return the GID of a participant: 16 bytes."""
        text = f"{self.key_prefix}/{name}".encode()
        return hashlib.blake2b(text, key=bytes.fromhex(self.secret), digest_size=16).digest()

    def encoder_gid(self, name: str) -> bytes:
        """Return the GID of the process that encodes the messages of a service."""
        return self.gid(f"{name}{ENCODER}" if name in self.external else name)

    def senders(self, key: str, names: Iterable[str]) -> dict[str, bytes | None]:
        """Return the GID that a message must carry, by Zenoh key; None for an external service, which chooses its own.

        Args:
            key: key of the lock step (`lapwing.cosim.transport.bus_keys`).
            names: names of the senders.
        """
        result: dict[str, bytes | None] = {}
        for name in names:
            gid = self.encoder_gid(name) if key == BATCH_KEY else None if name in self.external else self.gid(name)
            result[f"{self.key_prefix}/{key}/{name}"] = gid
        return result
