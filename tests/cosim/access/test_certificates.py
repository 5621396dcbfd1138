"""Certificates of participants: files, their permissions, and invalid certificates."""

import os
import re
import ssl
import stat

import pytest
import zenoh

from lapwing.cosim.access.certificates import make, tls
from lapwing.cosim.transport.bus import ZenohBus
from tests.commands import assert_rejected, run_command
from tests.endpoints import loopback_endpoints


def test_files_are_private_with_any_umask(tmp_path):
    umask = os.umask(0)
    try:
        make(tmp_path / "keys", ["plant"], 1)
    finally:
        os.umask(umask)
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in (tmp_path / "keys").rglob("*")}
    files = {"authority.pem": 0o644, "certificate.pem": 0o644, "key.pem": 0o600, "zenoh.json5": 0o600}
    assert modes == {"plant": 0o700, **files}


@pytest.mark.long
@pytest.mark.parametrize(
    ("place", "time", "message"),
    [(1, "200101000000Z", "expired on 2020-01-01"), (0, "490101000000Z", "is valid from 2049")],
)
def test_run_names_invalid_certificate(tmp_path, place, time, message):
    make(tmp_path / "keys", ["mission", "router", "plant"], 1)
    path = tmp_path / "keys" / "router" / "certificate.pem"
    der = ssl.PEM_cert_to_DER_cert(path.read_text())
    period = re.search(rb"\d{12}Z..\d{12}Z", der).group()
    times = [period[:13], period[-13:]]
    times[place] = time.encode()
    path.write_text(ssl.DER_cert_to_PEM_cert(der.replace(period, times[0] + period[13:15] + times[1])))
    (end,) = loopback_endpoints(["a"]).values()
    command = ["run", "hover", "--listen", end.replace("tcp/", "tls/"), "--keys", tmp_path / "keys"]
    done = run_command(*command, "--log", tmp_path / "a.mcap")
    assert_rejected(done, f"router/certificate.pem: {message}")
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.long
def test_client_configuration_is_independent_of_its_folder(tmp_path):
    make(tmp_path / "keys", ["plant", "viewer"], 1)
    taken = (tmp_path / "keys" / "viewer" / "zenoh.json5").rename(tmp_path / "taken.json5")
    (end,) = (each.replace("tcp/", "tls/") for each in loopback_endpoints(["plant"]).values())
    configuration = zenoh.Config.from_file(str(taken))
    configuration.insert_json5("connect/endpoints", f'["{end}"]')
    with ZenohBus([end], security=tls(tmp_path / "keys", "plant")) as plant, zenoh.open(configuration) as viewer:
        assert [str(each) for each in viewer.info.peers_zid()] == [plant.session_id]
