"""Compressed run configurations: exact, and bounded in size."""

import zlib

import pytest

from lapwing.cosim.config.serialise import LARGEST, compress, decompress, to_json
from lapwing.services.scene_resolver import load, resolve


def test_compressed_run_configuration_is_exact():
    config = resolve(load("hover"))
    assert decompress(compress(config)) == to_json(config)
    assert decompress(to_json(config).encode()) == to_json(config)


@pytest.mark.parametrize(
    "message",
    [b"", b"rubbish", b"{\xff", zlib.compress(b"a" * 100)[:-5], zlib.compress(bytes(LARGEST + 1))],
    ids=["nothing", "not packed", "no text", "cut short", "a bomb"],
)
def test_invalid_message_is_rejected(message):
    with pytest.raises(ValueError):
        decompress(message)
