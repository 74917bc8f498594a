"""A real Chromium."""

from collections.abc import Iterator
from contextlib import contextmanager

from peers import program
from playwright.sync_api import Browser, sync_playwright


@contextmanager
def chromium() -> Iterator[Browser]:
    """Debian's Chromium that needs no screen, or the one that this machine has, which takes half as much time again."""
    path = program("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()
