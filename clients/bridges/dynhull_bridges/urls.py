"""URLs of brokers and receivers: what follows the question mark, subjects of NATS, and how URLs are shown."""

import hashlib
import re
from collections.abc import Collection
from urllib.parse import parse_qs, urlsplit

TOKEN = re.compile(r"(?=[^/]*[0-9])(?=[^/]*[A-Za-z])[A-Za-z0-9_-]{20,}")  # in the path of a webhook
DIGITS_OF_A_TOKEN = 6


def without_secrets(url: str) -> str:
    """A URL without user, password and query, and of http without what looks like a token in the path."""
    parts = urlsplit(url)
    path = TOKEN.sub(_digest, parts.path) if parts.scheme in ("http", "https") else parts.path
    return parts._replace(netloc=parts.netloc.rpartition("@")[2], path=path, query="").geturl()


def _digest(token: re.Match[str]) -> str:
    """What distinguishes two of them."""
    return "\N{HORIZONTAL ELLIPSIS}" + hashlib.sha256(token[0].encode()).hexdigest()[:DIGITS_OF_A_TOKEN]


def options_of(url: str, known: Collection[str] = ()) -> dict[str, list[str]]:
    """The options after the question mark; ValueError names one that is not known, or has no value."""
    found = parse_qs(urlsplit(url, allow_fragments=False).query, keep_blank_values=True)
    for name, values in found.items():
        if name not in known:
            there = f"there is {' and '.join(sorted(known))}" if known else "there are none"
            raise ValueError(f"{without_secrets(url)} has no option {name!r} after the question mark: {there}")
        if not all(values):
            raise ValueError(f"{without_secrets(url)}: the option {name} has no value")
    return found


def check_subject(subject: str) -> None:
    """ValueError where NATS has no such subject, wildcards being words."""
    if any(each.isspace() or not each.isprintable() for each in subject) or not all(subject.split(".")):
        raise ValueError(f"{subject!r} is no subject of NATS: words without spaces, separated by single dots")
