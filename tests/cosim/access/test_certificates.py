"""Certificates of participants: what is written, and who may read and write it."""

import os
import stat

import pytest
import zenoh

from lapwing.cosim.access.certificates import make, tls
from lapwing.cosim.transport.bus import ZenohBus
from tests.endpoints import loopback_endpoints


def test_nobody_else_can_write_them_whatever_the_umask(tmp_path):
    umask = os.umask(0)
    try:
        make(tmp_path / "keys", ["plant"], 1)
    finally:
        os.umask(umask)
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in (tmp_path / "keys").rglob("*")}
    files = {"authority.pem": 0o644, "certificate.pem": 0o644, "key.pem": 0o600, "zenoh.json5": 0o600}
    assert modes == {"plant": 0o700, **files}


@pytest.mark.long
def test_a_configuration_serves_wherever_it_is_taken(tmp_path):
    make(tmp_path / "keys", ["plant", "viewer"], 1)
    taken = (tmp_path / "keys" / "viewer" / "zenoh.json5").rename(tmp_path / "taken.json5")
    (end,) = (each.replace("tcp/", "tls/") for each in loopback_endpoints(["plant"]).values())
    configuration = zenoh.Config.from_file(str(taken))
    configuration.insert_json5("connect/endpoints", f'["{end}"]')
    with ZenohBus([end], security=tls(tmp_path / "keys", "plant")) as plant, zenoh.open(configuration) as viewer:
        assert [str(each) for each in viewer.info.peers_zid()] == [plant.session_id]
