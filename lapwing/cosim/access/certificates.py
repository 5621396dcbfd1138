"""TLS certificates of participants on several hosts: one authority, and a folder for each participant.

FOLDER/NAME/authority.pem     trusted certificate authority
FOLDER/NAME/certificate.pem   NAME as its common name
FOLDER/NAME/key.pem           its private key, mode 0600
FOLDER/NAME/zenoh.json5       all of them in a Zenoh configuration for external programs; can be moved; mode 0600
"""

import base64
import json
import os
import re
import ssl
import stat
import subprocess
import tempfile
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

AUTHORITY, CERTIFICATE, KEY, CONFIGURATION = "authority.pem", "certificate.pem", "key.pem", "zenoh.json5"
_CURVE = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
# Two ASN.1 times (UTCTime or GeneralizedTime) in a sequence: the field `validity` (RFC 5280, section 4.1.2.5)
_TIME = rb"(?:\x17\x0d|\x18\x0f)(\d{12,14}Z)"
_VALIDITY = re.compile(rb"\x30." + _TIME + _TIME, re.DOTALL)
_LINKS = {
    "enable_mtls": True,
    # both ends identify their peer by its common name (lapwing.cosim.access.zenoh_access), not by its address
    "verify_name_on_connect": False,
    "close_link_on_expiration": True,
}


def make(folder: Path, names: Iterable[str], days: int) -> None:
    """Create a folder of certificates, completely or not at all. The authority's private key is deleted.

    Args:
        folder: folder to create; it must not exist.
        names: names of the participants.
        days: validity of the certificates [days].

    Raises:
        ValueError: the folder exists or cannot be created, or the program openssl is missing or fails.
    """
    if folder.exists():
        raise ValueError(f"{folder}: already exists; remove it, or choose another folder")
    try:
        with tempfile.TemporaryDirectory(dir=folder.absolute().parent, prefix=".keys-") as place:
            complete = Path(place) / "complete"
            complete.mkdir(mode=0o700)
            authority, secret = Path(place) / AUTHORITY, Path(place) / "authority.key"
            _openssl(
                *("-x509", *_CURVE, "-days", str(days), "-subj", "/CN=lapwing authority"),
                *("-addext", "basicConstraints=critical,CA:TRUE", "-addext", "keyUsage=critical,keyCertSign"),
                *("-keyout", str(secret), "-out", str(authority)),
            )
            for name in names:
                own = complete / name
                own.mkdir(mode=0o700)
                _openssl(
                    *("-x509", *_CURVE, "-days", str(days), "-subj", f"/CN={name}"),
                    *("-CA", str(authority), "-CAkey", str(secret), "-addext", f"subjectAltName=DNS:{name}"),
                    *("-addext", "basicConstraints=critical,CA:FALSE"),
                    *("-addext", "extendedKeyUsage=serverAuth,clientAuth"),
                    *("-keyout", str(own / KEY), "-out", str(own / CERTIFICATE)),
                )
                (own / AUTHORITY).write_bytes(authority.read_bytes())
                (own / CONFIGURATION).write_text(json.dumps(_configuration(own)) + "\n")
                for file in (AUTHORITY, CERTIFICATE):  # independent of the umask
                    (own / file).chmod(0o644)
                for file in (KEY, CONFIGURATION):
                    (own / file).chmod(0o600)
            complete.rename(folder)
    except OSError as error:
        raise ValueError(f"{folder}: cannot be created: {(error.strerror or str(error)).lower()}") from None


def tls(folder: Path, name: str) -> dict[str, Any]:
    """Return Zenoh's settings for the certificate of a participant.

    Raises:
        ValueError: it is missing, cannot be read, is not valid now, or other users can read its key.
    """
    own = folder.absolute() / name
    for file in (AUTHORITY, CERTIFICATE, KEY):
        if not os.access(own / file, os.R_OK):
            raise ValueError(
                f"--keys {folder}: {name}/{file} cannot be read; `lapwing certificates {folder}` creates it"
            )
    for file in (AUTHORITY, CERTIFICATE):
        _check_validity(own / file, f"--keys {folder}: {name}/{file}")
    if stat.S_IMODE((own / KEY).stat().st_mode) & 0o077:
        raise ValueError(f"--keys {folder}: other users can read {name}/{KEY}; use chmod 600")
    return {"transport/link/tls": _tls(own)}


def _check_validity(path: Path, location: str) -> None:
    """Raise ValueError for a file that is not a certificate, or is outside its period of validity."""
    try:
        result = _VALIDITY.search(ssl.PEM_cert_to_DER_cert(path.read_text().strip()))
    except ValueError:
        result = None
    if result is None:
        raise ValueError(f"{location}: is not a certificate; `lapwing certificates FOLDER` makes new ones")
    begin, end = (_time(text) for text in result.groups())
    now = datetime.now(UTC)
    if not begin <= now:
        raise ValueError(f"{location}: is valid from {begin:%Y-%m-%d %H:%M} UTC; check the clock of this machine")
    if now >= end:
        raise ValueError(
            f"{location}: expired on {end:%Y-%m-%d %H:%M} UTC; `lapwing certificates FOLDER` makes new ones"
        )


def _time(text: bytes) -> datetime:
    """Parse an ASN.1 time, whose year has two digits up to 2049, else four."""
    form = "%y%m%d%H%M%SZ" if len(text) == 13 else "%Y%m%d%H%M%SZ"
    return datetime.strptime(text.decode(), form).replace(tzinfo=UTC)


def _tls(own: Path) -> dict[str, Any]:
    key, certificate = str(own / KEY), str(own / CERTIFICATE)
    return {
        "root_ca_certificate": str(own / AUTHORITY),
        "listen_private_key": key,
        "listen_certificate": certificate,
        "connect_private_key": key,
        "connect_certificate": certificate,
        **_LINKS,
    }


def _configuration(own: Path) -> dict[str, Any]:
    """Return a client's settings with the contents of the files instead of their paths."""
    entries = {
        "root_ca_certificate_base64": AUTHORITY,
        "connect_private_key_base64": KEY,
        "connect_certificate_base64": CERTIFICATE,
    }
    contents = {entry: base64.b64encode((own / file).read_bytes()).decode() for entry, file in entries.items()}
    return {"mode": "client", "transport": {"link": {"tls": {**contents, **_LINKS}}}}


def _openssl(*arguments: str) -> None:
    try:
        subprocess.run(["openssl", "req", *arguments], check=True, capture_output=True, text=True)
    except FileNotFoundError:
        raise ValueError("openssl: no such program; install it to create certificates") from None
    except subprocess.CalledProcessError as error:
        raise ValueError(f"openssl: {error.stderr.strip().splitlines()[-1]}") from None
