"""The gateway behind nginx and Caddy, and under names that are not its own."""

import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from gateway_process import NDJSON, Events, Gateway, gateway_process
from patience import PATIENCE, wait_until
from peers import program
from ports import free_port

DEPLOY = Path(__file__).parents[2] / "deploy" / "nginx.conf"
NAMED = "hulls.example.org"


@contextmanager
def running(command: list[str], port: str) -> Iterator[Gateway]:
    """A proxy; yields what it shows below /dynhull."""
    proxied = Gateway(f"http://127.0.0.1:{port}/dynhull")
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            wait_until(lambda: answers(proxied))
            yield proxied
        finally:
            process.terminate()
            process.wait(PATIENCE)


def answers(proxied: Gateway) -> bool:
    try:
        return proxied.get("/livez", Host=NAMED).status == 200
    except OSError:
        return False


@contextmanager
def behind_nginx(behind: Gateway, folder: Path) -> Iterator[Gateway]:
    """The example of deploy/, with the ports of the test."""
    port = free_port()
    site = DEPLOY.read_text().replace("127.0.0.1:8080", behind.place).replace("listen 80;", f"listen 127.0.0.1:{port};")
    temporary = "".join(f"{each}_temp_path {folder};" for each in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
    (folder / "nginx.conf").write_text(
        f"daemon off; pid {folder}/pid; error_log {folder}/errors; events {{}}\n"
        f"http {{ access_log off; {temporary} {site} }}"
    )
    with running([program("nginx"), "-c", str(folder / "nginx.conf"), "-e", f"{folder}/errors"], port) as proxied:
        yield proxied


@contextmanager
def behind_caddy(behind: Gateway, folder: Path) -> Iterator[Gateway]:
    """Caddy removes the path, which the gateway takes as well."""
    port = free_port()
    (folder / "Caddyfile").write_text(
        f"{{\nadmin off\n}}\nhttp://:{port} {{\nhandle_path /dynhull/* {{\nreverse_proxy {behind.place}\n}}\n}}\n"
    )
    with running([program("caddy"), "run", "--config", str(folder / "Caddyfile")], port) as proxied:
        yield proxied


@pytest.fixture(scope="module")
def behind(address: str) -> Iterator[Gateway]:
    with gateway_process(address, "--root-path", "/dynhull", "--allow-host", NAMED) as running:
        yield Gateway(running.url.removesuffix("/dynhull"))


@pytest.mark.parametrize("proxy", [behind_nginx, behind_caddy])
def test_behind_a_proxy(behind: Gateway, tmp_path: Path, name: str, proxy) -> None:
    hull = f"{name[-40:]}/x"
    path = f"/hulls/{hull.replace('/', '%2F')}"
    with proxy(behind, tmp_path) as proxied:
        assert proxied.post("/hulls", {"name": hull}, Host=NAMED).status == 201
        body = b"".join(b"[%d, %d]\n" % (i, i * i) for i in range(20_000))
        assert proxied.post(f"{path}/rows", body, NDJSON, Host=NAMED).json["rows"] == 20_000
        data = proxied.get("/collections", Host=NAMED, X_Forwarded_Proto="https").json["links"][0]["href"]
        assert urlsplit(data).hostname == NAMED
        assert urlsplit(data).path == "/dynhull/collections"
        events = Events(proxied, f"{path}/events?f=vertices", Host=NAMED)
        kind, hull_now = events.next()
        assert (kind, hull_now["points"]) == ("snapshot", 20_000)
        sender = threading.Thread(target=lambda: proxied.post(f"{path}/points", [[-1, 0]], Host=NAMED))
        sender.start()
        assert events.next()[1]["points"] == 20_001  # at once, not when a buffer of the proxy is full
        sender.join()
        events.close()


def test_other_names_are_refused(behind: Gateway) -> None:
    refused = behind.get("/hulls", Host="rebound.example:80")
    assert (refused.status, refused.json["field"]) == (421, "Host")
    assert "--allow-host" in refused.json["detail"]
    connection = behind.connection()
    connection.putrequest("GET", "/hulls", skip_host=True)
    for name in (NAMED, "rebound.example"):
        connection.putheader("Host", name)
    connection.endheaders()
    assert connection.getresponse().status == 421
    connection.close()
    assert behind.get("/hulls", Host=f"{NAMED}:8443").status == 200
    assert behind.get("/dynhull/hulls").status == 200
