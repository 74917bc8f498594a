"""A server that is older than its gateway does not know all of its calls."""

from gateway_process import gateway_process
from older_server import older_server


def test_the_gateway_says_which_call_and_what_to_do() -> None:
    with older_server() as address, gateway_process(address) as gateway:
        answer = gateway.get("/hulls/fleet")
        assert (answer.status, answer.headers["Content-Type"]) == (501, "application/problem+json")
        assert answer.json["reason"] == "METHOD_UNKNOWN"
        assert answer.json["detail"].startswith(
            "the server does not know the call GetHull: it is older than its client"
        )
        assert answer.json["detail"].endswith("upgrade the server first")
