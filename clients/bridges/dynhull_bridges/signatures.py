"""Signatures of webhooks, as https://www.standardwebhooks.com specifies them."""

import base64
import hashlib
import hmac
from collections.abc import Sequence

PREFIX = "whsec_"
FEWEST_BYTES, MOST_BYTES = 24, 64


def read_secret(text: str) -> bytes:
    """The key in a secret such as whsec_...; ValueError if it is none. The message does not repeat the secret."""
    try:
        key = base64.b64decode(text.strip().removeprefix(PREFIX), validate=True)
    except ValueError:  # neither base64 nor ASCII
        key = b""
    if not (text.strip().startswith(PREFIX) and FEWEST_BYTES <= len(key) <= MOST_BYTES):
        raise ValueError(
            f"a secret must be whsec_ and base64 of {FEWEST_BYTES} to {MOST_BYTES} random bytes: look at --secret and "
            "DYNHULL_WEBHOOK_SECRET"
        )
    return key


def signature(keys: Sequence[bytes], identity: str, timestamp: int, body: str) -> str:
    """The value of the header webhook-signature: one signature for each key, so that receivers can change keys."""
    signed = f"{identity}.{timestamp}.{body}".encode()
    digests = (hmac.new(key, signed, hashlib.sha256).digest() for key in keys)
    return " ".join(f"v1,{base64.b64encode(each).decode()}" for each in digests)
