"""Map tiles of another server under hulls on the globe."""

import re
from dataclasses import dataclass
from urllib.parse import urlsplit

FIELDS = "{z}", "{x}", "{y}"
LARGEST_ZOOM, LARGEST_PORT = 24, 65535
# What may stand in a URL. A policy cannot name an address of IPv6.
TEMPLATE = re.compile(r"https?://[A-Za-z0-9.-]+(?P<port>:[0-9]{1,5})?/[A-Za-z0-9\-._~:/?@!$&*+,=%{}]*")


@dataclass(frozen=True, slots=True)
class Tiles:
    """Square pictures of a map in the Web Mercator projection, 4**zoom of them at each zoom.

    Args:
        url: with {z}, {x} and {y} for the zoom, the column from 180 degrees west and the row from the north.
        attribution: what the provider wants to be shown.
        largest_zoom: tiles of larger zooms are not requested.

    Raises:
        ValueError: if it is no such URL.
    """

    url: str
    attribution: str = ""
    largest_zoom: int = 19

    def __post_init__(self) -> None:
        problem = _problem(self.url)
        if problem:
            raise ValueError(f"--tiles is {self.url!r}: {problem}, as in https://HOST/{{z}}/{{x}}/{{y}}.png")

    @property
    def origin(self) -> str:
        """Scheme, host and port."""
        scheme, host, *_ = urlsplit(self.url)
        return f"{scheme}://{host}"


def _problem(url: str) -> str:
    """Why a URL cannot be that of tiles; empty if it can."""
    found = TEMPLATE.fullmatch(url)
    if found is None or int((found["port"] or ":0")[1:]) > LARGEST_PORT:
        return "expected http:// or https://, the name of a host, and a path of the characters that URLs have"
    if any(url.count(field) != 1 for field in FIELDS) or len(re.findall("[{}]", url)) != 2 * len(FIELDS):
        return "expected each of {z}, {x} and {y} once, and no other braces"
    return ""
