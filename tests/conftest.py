"""Tests keep their machine code apart from the product's: theirs names classes that only tests can import."""

import hashlib
import os
from pathlib import Path

TESTS = Path(__file__).parent

_digest = hashlib.blake2b(digest_size=8)
for _path in sorted(TESTS.rglob("*.py")):
    if b"dynamics.kernel" in (_source := _path.read_bytes()):  # compiled code of its own
        _digest.update(_source)
_base = Path(os.environ.get("LAPWING_CACHE", Path.home() / ".cache" / "lapwing"))
os.environ["LAPWING_CACHE"] = str(_base / f"tests-{_digest.hexdigest()}")
