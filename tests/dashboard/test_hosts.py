"""The dashboard answers only under its own names, only to its own pages, and changes nothing."""

import http.client
import json
import re
import urllib.request
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest
from dashboard_process import dashboard_process
from patience import PATIENCE
from server_process import run

from dynhull_client import HullClient
from dynhull_gateway.page import VENDOR

NAMED = "hulls.example.org:5006"
PROXIED = "https://proxied.example.org"
PATHS = "/", "/dashboard", "/hulls", "/dashboard/version"


@pytest.fixture(scope="module")
def dashboard(address: str) -> Iterator[str]:
    """HOST:PORT of a dashboard."""
    with dashboard_process(address, "--origin", NAMED, "--origin", PROXIED) as url:
        yield urlsplit(url).netloc


def answer(dashboard: str, path: str, method: str = "GET", body: str | None = None, **headers: str) -> tuple[int, str]:
    """The status, and the text of a refusal."""
    connection = http.client.HTTPConnection(dashboard, timeout=PATIENCE)
    try:
        connection.request(method, path, body, headers=headers)
        response = connection.getresponse()
        refused = response.status == http.HTTPStatus.FORBIDDEN
        return response.status, response.read().decode() if refused else ""
    finally:
        connection.close()


def status(dashboard: str, path: str, **headers: str) -> int:
    return answer(dashboard, path, **headers)[0]


@pytest.mark.parametrize("path", PATHS)
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
    assert f"cannot listen on 127.0.0.1:{port}: another program uses this port" in ended.stderr


@pytest.mark.parametrize("path", PATHS)
def test_its_own_names_are_answered(dashboard: str, path: str) -> None:
    proxied = PROXIED.rpartition("/")[2]
    assert status(dashboard, path, Host=proxied, Origin=PROXIED) == http.HTTPStatus.OK
    port = dashboard.rpartition(":")[2]
    for host in (dashboard, f"LocalHost:{port}", f"[::1]:{port}", NAMED):
        assert status(dashboard, path, Host=host, Origin=f"http://{host}") == http.HTTPStatus.OK
    assert status(dashboard, path, Host=dashboard, Origin=f"https://{NAMED}") == http.HTTPStatus.OK


def test_whether_the_page_is_there_can_be_asked(dashboard: str) -> None:
    connection = http.client.HTTPConnection(dashboard, timeout=PATIENCE)
    connection.request("HEAD", "/")
    answered = connection.getresponse()
    assert (answered.status, answered.read()) == (http.HTTPStatus.OK, b"")
    connection.close()


def test_a_write_is_refused_whatever_the_token(address: str, dashboard: str, name: str) -> None:
    as_json = {"Content-Type": "application/json", "Authorization": "Bearer anything"}
    with HullClient(address) as client:
        client.create_hull(name)
        writes = [
            ("POST", "/hulls", '{"name": "another"}'),
            ("POST", f"/hulls/{name}/points", "[[0, 0]]"),
            ("POST", f"/hulls/{name}/rows", "0,0\n"),
            ("POST", "/transfers", "{}"),
            ("POST", f"/hulls/{name}/recenter", "{}"),
            ("POST", f"/hulls/{name}/reshard", "{}"),
            ("PUT", f"/hulls/{name}/history", "{}"),
            ("POST", f"/hulls/{name}/history/erase", "{}"),
            ("PUT", f"/hulls/{name}/quarantine", "{}"),
            ("DELETE", f"/hulls/{name}", None),
            ("POST", "/fences", "{}"),
            ("PUT", "/fences/a", "{}"),
            ("DELETE", "/fences/a", None),
            ("PUT", "/fences/a/consumers/c", "{}"),
            ("DELETE", "/fences/a/consumers/c", None),
            ("POST", "/alarms", "{}"),
            ("DELETE", "/alarms/a", None),
            ("PUT", "/alarms/a/consumers/c", "{}"),
            ("PUT", f"/hulls/{name}/feed/consumers/c", "{}"),
            ("PUT", "/feed/consumers/c", "{}"),
            ("PATCH", f"/hulls/{name}", "{}"),
            ("POST", f"/hulls/{name}%2Flocate", "{}"),
        ]
        for method, path, body in writes:
            code, text = answer(dashboard, path, method, body, **as_json)
            assert (code, json.loads(text)["reason"]) == (http.HTTPStatus.FORBIDDEN, "READ_ONLY"), path
        assert client.get_hull(name).info.revision == 0
        assert (
            answer(
                dashboard,
                f"/hulls/{name}/locate",
                "POST",
                '{"points": [[0, 0]]}',
                **{"Content-Type": "application/json"},
            )[0]
            == http.HTTPStatus.OK
        )


def test_each_call_that_changes_something_is_known(dashboard: str) -> None:
    """Of all calls of the gateway, those that are no questions are refused."""
    with urllib.request.urlopen(f"http://{dashboard}/openapi.json", timeout=PATIENCE) as answered:
        paths = json.load(answered)["paths"]
    asked = {
        (method.upper(), path): answer(dashboard, re.sub(r"\{\w+\}", "x", path), method.upper())[0]
        for path, operations in paths.items()
        for method in operations
        if method != "get"
    }
    allowed = {path for path, code in asked.items() if code != http.HTTPStatus.FORBIDDEN}
    questions = (
        "locate",
        "distance",
        "count",
        "support",
        "tangents",
        "intersect-lines",
        "positions",
        "phase-diagram",
        "frontier",
    )
    of_streams = {(method, "/streams/{stream}/subscriptions/{subscription}") for method in ("PUT", "DELETE")}
    of_alarms = {("POST", f"/alarms/{{name}}/{each}") for each in ("acknowledge", "mute")}
    assert allowed == {
        *(("POST", f"/hulls/{{name}}/{each}") for each in questions),
        ("POST", "/streams"),
        ("POST", "/fences/between"),
        *of_streams,
        *of_alarms,
    }


def test_what_the_page_uses_of_others_comes_with_its_licences(dashboard: str) -> None:
    files = [each.relative_to(VENDOR).as_posix() for each in VENDOR.rglob("*") if each.is_file()]
    licences = (VENDOR / "LICENSES.txt").read_text("utf-8")
    named = {each.partition("/")[0] for each in files} - {"LICENSES.txt"}
    assert all(name in licences for name in named)
    assert len(re.findall(r"^(?:[a-z0-9-]+) [0-9.]+: ", licences, re.MULTILINE)) == 7
    with urllib.request.urlopen(f"http://{dashboard}/", timeout=PATIENCE) as answered:
        html = answered.read().decode()
    (folder,) = {each.rpartition("/")[0] for each in re.findall(r'src="([^"]*)"', html)}
    assert all(status(dashboard, f"{folder}/vendor/{name}") == http.HTTPStatus.OK for name in files)
    assert status(dashboard, f"{folder}/vendor/../__init__.py") == http.HTTPStatus.NOT_FOUND
    assert status(dashboard, f"{folder}/__init__.py") == http.HTTPStatus.NOT_FOUND
