"""Where the past may be: in a folder, or in an object store with an address that has no secrets."""

from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit

SCHEME = "s3"
OPTIONS = ("region", "scheme", "endpoint_override")
FORM = f"{SCHEME}://BUCKET/PREFIX, perhaps with ?{'=…&'.join(OPTIONS)}=…"


def is_store(place: str | Path) -> bool:
    """Whether a place is not a folder, but has the form of a URL."""
    return ":/" in str(place)


def require_store(place: str) -> None:
    """Raise ValueError, which does not repeat the place, if it is no address of an object store, or has secrets."""
    parts = urlsplit(place)
    if parts.scheme != SCHEME or not parts.netloc:
        raise ValueError(f"is neither a folder nor {FORM}")
    plain = unquote(parts.netloc)
    if "@" in unquote(place) or ":" in plain or "%" in plain:  # a secret may have any character, also as its number
        raise ValueError(
            "has credentials: leave them out. They come from AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, "
            "from ~/.aws, or from the machine"
        )
    unknown = [name for name in parse_qs(parts.query, keep_blank_values=True) if name not in OPTIONS]
    if unknown or parts.fragment:
        raise ValueError(f"has more than {FORM}")
