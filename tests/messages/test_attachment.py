import pytest

from lapwing.messages.attachment import pack, time_and_gid

GID = bytes(range(16))


def test_layout_byte_by_byte():
    assert pack(1, 2, GID) == b"\1" + bytes(7) + b"\2" + bytes(7) + b"\x10" + GID
    assert len(pack(-1, 2**62, GID)) == 33


def test_attachment_round_trips():
    assert time_and_gid(pack(7, 123456789012, GID)) == (123456789012, GID)
    assert time_and_gid(pack(7, -5, GID)) == (-5, GID)


def test_invalid_attachment_is_rejected():
    with pytest.raises(ValueError, match="15 bytes, expected 16"):
        pack(0, 0, GID[:15])
    for damaged in (b"", pack(0, 0, GID)[:-1], pack(0, 0, GID) + b"\0", bytes(16) + b"\x11" + GID):
        with pytest.raises(ValueError, match="not an attachment"):
            time_and_gid(damaged)
