"""Whose messages count: each participant of a run marks what it publishes, and nobody else's marks are taken.

A mark is the publisher's identifier in the attachment. A run on one machine makes the marks from a secret that its
launcher draws and hands over on standard input. Participants that were started separately share no secret: there a
mark only tells one run from another, and certificates keep strangers out (docs/explanation/security.md).
"""

import hashlib
import secrets
from collections.abc import Collection, Iterable
from typing import NamedTuple

from lapwing.cosim.transport.bus_keys import BATCH_KEY, ENCODER


def new_secret() -> str:
    """A secret for one run, 64 hexadecimal digits, from which its participants derive their marks."""
    return secrets.token_hex(32)


class PublisherIds(NamedTuple):
    """The participants of one run: the marks by which their messages are known."""

    key_prefix: str
    secret: str = ""  # hexadecimal; "" where they share none
    external: Collection[str] = ()  # programs of somebody else's, which choose their own marks

    def mark(self, name: str) -> bytes:
        """What a participant's messages carry: 16 bytes."""
        text = f"{self.key_prefix}/{name}".encode()
        return hashlib.blake2b(text, key=bytes.fromhex(self.secret), digest_size=16).digest()

    def author(self, name: str) -> bytes:
        """The mark of whoever makes the messages of a service."""
        return self.mark(f"{name}{ENCODER}" if name in self.external else name)

    def senders(self, key: str, names: Iterable[str]) -> dict[str, bytes | None]:
        """The mark that a message must carry, by Zenoh key; None where a program chooses its own.

        Args:
            key: of the lock step (`lapwing.cosim.transport.bus_keys`).
            names: whose messages on it are wanted.
        """
        found: dict[str, bytes | None] = {}
        for name in names:
            mark = self.author(name) if key == BATCH_KEY else None if name in self.external else self.mark(name)
            found[f"{self.key_prefix}/{key}/{name}"] = mark
        return found
