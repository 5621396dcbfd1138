"""Addresses that users give, HOST:PORT, and which of them other machines reach."""

import ipaddress
import re


def host_and_port(text: str) -> tuple[str, int] | None:
    """Host, an IPv6 address without its brackets, and port of HOST:PORT; None where it is not of this form."""
    found = re.fullmatch(r"\[?([\w.:-]+?)\]?:(\d{1,5})", text)
    return (found[1], int(found[2])) if found and int(found[2]) <= 65535 else None


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches a host, a number or a name."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
