"""Parsing of HOST:PORT addresses."""

import ipaddress
import re


def host_and_port(text: str) -> tuple[str, int] | None:
    """Return host (IPv6 without brackets) and port of HOST:PORT. Return None if the text has another form."""
    match = re.fullmatch(r"\[?([\w.:-]+?)\]?:(\d{1,5})", text)
    return (match[1], int(match[2])) if match and int(match[2]) <= 65535 else None


def is_loopback(host: str) -> bool:
    """Return True if only this machine reaches the host, an address or a name."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
