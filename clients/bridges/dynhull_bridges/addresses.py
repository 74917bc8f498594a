"""Which addresses webhooks may go to: by default no private ones, so that a URL from elsewhere cannot reach inside."""

import errno
import ipaddress
import socket
from ipaddress import IPv4Address, IPv6Address

from aiohttp.abc import AbstractResolver, ResolveResult
from aiohttp.resolver import ThreadedResolver

NAT64 = ipaddress.IPv6Network("64:ff9b::/96")


class PrivateAddressError(OSError):
    """A host has an address that is not public."""


def is_public(address: str) -> bool:
    """Whether an address is one of the internet, also if it is an IPv4 address inside of an IPv6 address."""
    value = ipaddress.ip_address(address.partition("%")[0])
    return all(each.is_global and not each.is_multicast for each in (value, *_embedded(value)))


class PublicOnly(AbstractResolver):
    """Resolves names to public addresses.

    The connection goes to the address that was checked: a name that changes its address in between gains nothing.
    """

    def __init__(self) -> None:
        self._inner = ThreadedResolver()

    async def resolve(
        self, host: str, port: int = 0, family: socket.AddressFamily = socket.AF_INET
    ) -> list[ResolveResult]:
        """The public addresses of a host; PrivateAddressError if it has others only."""
        found = await self._inner.resolve(host, port, family)
        public = [each for each in found if is_public(each["host"])]
        if not public:
            raise PrivateAddressError(errno.EACCES, f"{host} has the private address {found[0]['host']}")
        return public

    async def close(self) -> None:
        """Nothing to release."""
        await self._inner.close()


def _embedded(value: IPv4Address | IPv6Address) -> list[IPv4Address]:
    if isinstance(value, IPv4Address):
        return []
    found = [value.ipv4_mapped, value.sixtofour, *(value.teredo or ())]
    if value in NAT64:
        found.append(IPv4Address(int(value) & 0xFFFFFFFF))
    return [each for each in found if each is not None]
