"""The dashboard answers only under its own names, and only to its own pages."""

import asyncio
import http.client
import re
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import urlsplit

import pytest
from dashboard_process import dashboard_process
from patience import PATIENCE
from server_process import run
from tornado.websocket import websocket_connect

from dynhull_dashboard.page import VENDOR

UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
}
NAMED = "hulls.example.org:5006"
PROXIED = "https://proxied.example.org"
LIVE = "/live"


@pytest.fixture(scope="module")
def dashboard(address: str) -> Iterator[str]:
    """HOST:PORT of a dashboard."""
    with dashboard_process(address, "--origin", NAMED, "--origin", PROXIED) as url:
        yield urlsplit(url).netloc


def answer(dashboard: str, path: str, **headers: str) -> tuple[int, str]:
    """The status, and the text of a refusal."""
    connection = http.client.HTTPConnection(dashboard, timeout=PATIENCE)
    try:
        connection.request("GET", path, headers={**(UPGRADE if path == LIVE else {}), **headers})
        response = connection.getresponse()
        refused = response.status == http.HTTPStatus.FORBIDDEN
        return response.status, response.read().decode() if refused else ""
    finally:
        connection.close()


def status(dashboard: str, path: str, **headers: str) -> int:
    return answer(dashboard, path, **headers)[0]


@pytest.mark.parametrize("path", ["/", "/vendor/d3-geo.min.js", LIVE])
def test_unknown_hosts_and_origins_are_refused(dashboard: str, path: str) -> None:
    rebound = f"evil.example:{dashboard.rpartition(':')[2]}"
    assert status(dashboard, path, Host=rebound, Origin=f"http://{rebound}") == http.HTTPStatus.FORBIDDEN
    assert status(dashboard, path, Host=rebound) == http.HTTPStatus.FORBIDDEN
    assert status(dashboard, path, Origin=f"http://{rebound}") == http.HTTPStatus.FORBIDDEN
    assert status(dashboard, path, Origin="null") == http.HTTPStatus.FORBIDDEN


def test_a_refusal_names_the_option_that_allows_the_name(address: str, dashboard: str) -> None:
    by_host = {"Host": "one.example:5006"}
    by_origin = {"Host": NAMED, "Origin": "http://two.example:5006"}
    advised = []
    for headers in (by_host, by_origin):
        code, text = answer(dashboard, "/", **headers)
        assert code == http.HTTPStatus.FORBIDDEN
        advised += ["--origin", text.rpartition("--origin ")[2].strip()]
    assert advised == ["--origin", "one.example:5006", "--origin", "http://two.example:5006"]
    with dashboard_process(address, "--host", "::1", "--origin", NAMED, *advised) as url:
        assert urlsplit(url).hostname == "::1"
        for headers in ({}, by_host, by_origin):
            assert status(urlsplit(url).netloc, "/", **headers) == http.HTTPStatus.OK


def test_a_name_that_cannot_be_one_is_an_error(address: str) -> None:
    ended = run("dashboard", "--port", "0", "--address", address, "--origin", "*.example.org")
    assert ended.returncode == 2
    assert "--origin is '*.example.org': expected HOST or HOST:PORT" in ended.stderr


def test_a_port_in_use_is_named(address: str, dashboard: str) -> None:
    port = dashboard.rpartition(":")[2]
    ended = run("dashboard", "--port", port, "--address", address)
    assert ended.returncode == 2
    assert ended.stderr == (
        f"error: cannot listen on 127.0.0.1:{port}: another program uses this port: choose another with --port\n"
    )


@pytest.mark.parametrize("path", ["/", LIVE])
def test_its_own_names_are_answered(dashboard: str, path: str) -> None:
    expected = http.HTTPStatus.SWITCHING_PROTOCOLS if path == LIVE else http.HTTPStatus.OK
    proxied = PROXIED.rpartition("/")[2]
    assert status(dashboard, path, Host=proxied, Origin=PROXIED) == expected
    port = dashboard.rpartition(":")[2]
    for host in (dashboard, f"LocalHost:{port}", f"[::1]:{port}", NAMED):
        assert status(dashboard, path, Host=host, Origin=f"http://{host}") == expected
    assert status(dashboard, path, Host=dashboard, Origin=f"https://{NAMED}") == expected


def test_whether_the_page_is_there_can_be_asked(dashboard: str) -> None:
    connection = http.client.HTTPConnection(dashboard, timeout=PATIENCE)
    connection.request("HEAD", "/")
    answered = connection.getresponse()
    assert (answered.status, answered.read()) == (http.HTTPStatus.OK, b"")
    connection.close()


def test_what_the_page_uses_of_others_comes_with_its_licences(dashboard: str) -> None:
    files = {each.name for each in VENDOR.iterdir()}
    licences = (VENDOR / "LICENSES.txt").read_text("utf-8")
    assert all(name in licences for name in files - {"LICENSES.txt"})
    assert len(re.findall("provided that the above copyright notice", licences)) == 5
    used = {name for name in files if name in page_and_scripts(dashboard)}
    assert used == files - {"LICENSES.txt"}
    assert all(status(dashboard, f"/vendor/{name}") == http.HTTPStatus.OK for name in files)
    assert status(dashboard, "/vendor/../page/page.html") == http.HTTPStatus.FORBIDDEN


def page_and_scripts(dashboard: str) -> str:
    with urllib.request.urlopen(f"http://{dashboard}/", timeout=PATIENCE) as answered:
        text: str = answered.read().decode()
    return text


@pytest.mark.parametrize(
    "sent", ["{", "[]", '{"hulls": 3}', '{"fences": [1]}', '{"hulls": ["\\ud800"]}', '{"other": ""}']
)
def test_a_page_that_asks_for_nonsense_is_closed(dashboard: str, sent: str) -> None:
    async def closed() -> int | None:
        socket = await websocket_connect(f"ws://{dashboard}/live?hull=none")
        try:
            async with asyncio.timeout(PATIENCE):
                await socket.read_message()
                await socket.write_message(sent)
                while await socket.read_message() is not None:
                    pass
            return socket.close_code
        finally:
            socket.close()

    with ThreadPoolExecutor() as threads:  # in this one, the event loop of a browser may be running
        assert threads.submit(asyncio.run, closed()).result() == 1003
    assert status(dashboard, "/") == http.HTTPStatus.OK
