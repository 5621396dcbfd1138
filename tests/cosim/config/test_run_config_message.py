"""Set-ups as messages: the same again, and nothing that unpacks without end."""

import zlib

import pytest

from lapwing.cosim.config.run_config_message import LARGEST, pack, unpack
from lapwing.cosim.config.serialise import to_json
from lapwing.services.scene_resolver import load, resolve


def test_a_set_up_is_the_same_again():
    setup = resolve(load("hover"))
    assert unpack(pack(setup)) == to_json(setup)
    assert unpack(to_json(setup).encode()) == to_json(setup)


@pytest.mark.parametrize(
    "message",
    [b"", b"rubbish", b"{\xff", zlib.compress(b"a" * 100)[:-5], zlib.compress(bytes(LARGEST + 1))],
    ids=["nothing", "not packed", "no text", "cut short", "a bomb"],
)
def test_anything_else_is_refused(message):
    with pytest.raises(ValueError):
        unpack(message)
