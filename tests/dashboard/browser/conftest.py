from collections.abc import Iterator
from pathlib import Path

import pytest
from cases import in_browser
from chromium import chromium
from dashboard_process import dashboard_process
from metrics import measured
from playwright.sync_api import Browser
from server_process import Server

from dynhull_client import HullClient

HERE = Path(__file__).parent


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Pages in a browser take a fifth of the processor time of all tests: `make test` opens some."""
    for item in items:
        in_page = "browser" in getattr(item, "fixturenames", ()) and item.path.parent == HERE
        if in_page and item.get_closest_marker("smoke") is None:
            item.add_marker(in_browser)


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """A real Chromium, whose first page takes several times as long as the next ones."""
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def server() -> Iterator[tuple[Server, str]]:
    """A server, and the address of its metrics; empty for one that has none."""
    with measured() as running:
        yield running


@pytest.fixture(scope="module")
def url(server: tuple[Server, str]) -> Iterator[str]:
    metrics = ["--metrics", f"http://{server[1]}/metrics"] if server[1] else []
    with dashboard_process(server[0].address, *metrics) as url:
        yield url


@pytest.fixture(scope="module")
def client(server: tuple[Server, str]) -> Iterator[HullClient]:
    with HullClient(server[0].address) as client:
        yield client
