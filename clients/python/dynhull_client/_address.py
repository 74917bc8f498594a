"""Addresses of servers, as people write them."""

import os
import re
from ipaddress import AddressValueError, IPv6Address, ip_address
from urllib.parse import urlsplit

DEFAULT_PORT = 50051
MAX_PORT = 65535
TLS_BY_SCHEME = {"": False, "http": False, "https": True, "grpc": False, "grpcs": True}
RESOLVERS = ("dns", "ipv4", "ipv6", "unix", "unix-abstract", "vsock", "xds")  # gRPC's own names, passed through

# Where gRPC finds its proxy, and names that it connects to without one, by their ends; the first that is set counts.
PROXIES = "grpc_proxy", "https_proxy", "http_proxy"
WITHOUT_PROXY = "no_grpc_proxy", "no_proxy"

PLACE = re.compile(r"(?P<host>\[[\w:.%]+\]|[^:\[\]/\s]+)(?::(?P<port>\d+))?")
EXAMPLE = f"Write HOST or HOST:PORT, for example 127.0.0.1:{DEFAULT_PORT}"


def target(address: str) -> tuple[str, bool]:
    """The target for gRPC, and whether the address asks for TLS.

    The port is 50051 unless given. http:// and grpc:// add nothing to HOST:PORT; https:// and grpcs:// ask for TLS.
    A bare IPv6 address needs no brackets. ValueError or TypeError where the address cannot be understood.
    """
    if not isinstance(address, str):
        raise TypeError(f"address is {address!r}: must be a string. {EXAMPLE}")
    if address.split(":", 1)[0] in RESOLVERS:
        return address, False
    before, mark, after = address.partition("://")
    scheme, place = (before.lower(), after.removesuffix("/")) if mark else ("", address)
    if scheme not in TLS_BY_SCHEME:
        raise ValueError(f"address {address!r}: there is no scheme {scheme}:// for servers. {EXAMPLE}")
    found = PLACE.fullmatch(f"[{place}]" if _is_ipv6(place) else place)
    if found is None:
        raise ValueError(f"address {address!r} is not a host and a port. {EXAMPLE}")
    port = int(found["port"] or DEFAULT_PORT)
    if not 0 < port <= MAX_PORT:
        raise ValueError(f"address {address!r}: port {port} is not from 1 to {MAX_PORT}. {EXAMPLE}")
    return f"{found['host']}:{port}", TLS_BY_SCHEME[scheme]


def is_local(target: str) -> bool:
    """Whether a target is this machine, which no proxy leads to."""
    if target.startswith("unix"):
        return True
    host = _host(target)
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def proxy_of(target: str) -> str | None:
    """The proxy that gRPC asks for a connection to a target, and the variable that names it; None if it asks none."""
    variable = next((each for each in PROXIES if os.environ.get(each)), None)
    direct = next((found for each in WITHOUT_PROXY if (found := os.environ.get(each))), "")
    ends = tuple(end for each in direct.split(",") if (end := each.strip()))
    if variable is None or is_local(target) or _host(target).endswith(ends):
        return None
    return f"{urlsplit(os.environ[variable]).netloc.rpartition('@')[2]} of {variable}"


def _host(target: str) -> str:
    """The host of a target, which may begin with the name of a resolver."""
    place = target.rpartition("/")[2]
    kind, _, rest = place.partition(":")
    return (rest if kind in RESOLVERS else place).rpartition(":")[0].strip("[]")


def _is_ipv6(text: str) -> bool:
    try:
        IPv6Address(text)
    except AddressValueError:
        return False
    return True
