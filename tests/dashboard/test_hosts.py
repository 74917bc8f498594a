"""What the dashboard answers to: its own names, and its own pages."""

import http.client
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest
from dashboard_process import dashboard_process
from server_process import PATIENCE

UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
}
NAMED = "hulls.example.org:5006"


@pytest.fixture(scope="module")
def dashboard(address: str) -> Iterator[str]:
    """HOST:PORT of a dashboard."""
    with dashboard_process(address, "--origin", NAMED) as url:
        yield urlsplit(url).netloc


def status(dashboard: str, path: str, **headers: str) -> int:
    connection = http.client.HTTPConnection(dashboard, timeout=PATIENCE)
    try:
        connection.request("GET", path, headers={**(UPGRADE if path == "/hulls" else {}), **headers})
        return connection.getresponse().status
    finally:
        connection.close()


@pytest.mark.parametrize("path", ["/", "/hulls"])
def test_a_name_that_was_made_to_lead_here_is_refused(dashboard: str, path: str) -> None:
    rebound = f"evil.example:{dashboard.rpartition(':')[2]}"
    assert status(dashboard, path, Host=rebound, Origin=f"http://{rebound}") == http.HTTPStatus.FORBIDDEN
    assert status(dashboard, path, Host=rebound) == http.HTTPStatus.FORBIDDEN
    assert status(dashboard, path, Origin=f"http://{rebound}") == http.HTTPStatus.FORBIDDEN
    assert status(dashboard, path, Origin="null") == http.HTTPStatus.FORBIDDEN


@pytest.mark.parametrize("path", ["/", "/hulls"])
def test_its_own_names_are_answered(dashboard: str, path: str) -> None:
    expected = http.HTTPStatus.SWITCHING_PROTOCOLS if path == "/hulls" else http.HTTPStatus.OK
    port = dashboard.rpartition(":")[2]
    for host in (dashboard, f"LocalHost:{port}", f"[::1]:{port}", NAMED):
        assert status(dashboard, path, Host=host, Origin=f"http://{host}") == expected
    assert status(dashboard, path, Host=dashboard, Origin=f"https://{NAMED}") == expected
