"""What the relay signs, the official library of Standard Webhooks accepts."""

import base64
import time

import pytest
from standardwebhooks import Webhook, WebhookVerificationError

from dynhull_bridges.signatures import read_secret, signature

OLD, NEW, OTHER = (f"whsec_{base64.b64encode(bytes([i]) * 24).decode()}" for i in range(3))
BODY = '{"type": "dynhull.fence.enter", "key": "Ä"}'


def headers(*secrets: str, body: str = BODY) -> dict[str, str]:
    now = int(time.time())
    signed = signature([read_secret(each) for each in secrets], "uid-1", now, body)
    return {"webhook-id": "uid-1", "webhook-timestamp": str(now), "webhook-signature": signed}


def test_the_official_library_verifies_it() -> None:
    assert Webhook(NEW).verify(BODY, headers(NEW))["key"] == "Ä"


def test_either_of_two_secrets_verifies_it() -> None:
    for secret in (OLD, NEW):
        Webhook(secret).verify(BODY, headers(OLD, NEW))
    with pytest.raises(WebhookVerificationError):
        Webhook(OTHER).verify(BODY, headers(OLD, NEW))


def test_another_body_is_not_verified() -> None:
    with pytest.raises(WebhookVerificationError):
        Webhook(NEW).verify(BODY, headers(NEW, body="{}"))


@pytest.mark.parametrize("secret", ["", "secret", "whsec_", "whsec_c2hvcnQ=", OLD.removeprefix("whsec_"), "whsec_!"])
def test_what_is_no_secret_is_refused_and_not_shown(secret: str) -> None:
    with pytest.raises(ValueError, match="a secret must be whsec_ and base64") as refused:
        read_secret(secret)
    assert "c2hvcnQ" not in str(refused.value)
