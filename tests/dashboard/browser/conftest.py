from collections.abc import Iterator

import pytest
from chromium import chromium
from playwright.sync_api import Browser


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """A real Chromium, whose first page takes several times as long as the next ones."""
    with chromium() as browser:
        yield browser
