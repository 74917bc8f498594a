"""URLs of brokers and receivers: what follows the question mark, subjects of NATS, and how URLs are shown."""

from collections.abc import Collection
from urllib.parse import parse_qs, urlsplit


def without_secrets(url: str) -> str:
    """A URL without user, password and query."""
    parts = urlsplit(url)
    return parts._replace(netloc=parts.netloc.rpartition("@")[2], query="").geturl()


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
