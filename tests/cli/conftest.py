import pytest
from forked import Process


@pytest.fixture
def served(address, monkeypatch):
    """The address of a server that commands find by themselves."""
    monkeypatch.setenv("DYNHULL_ADDRESS", address)
    return address


@pytest.fixture(autouse=True)
def _forked(monkeypatch):
    """The servers of demos that run in this process are forked, as those of commands are."""
    monkeypatch.setattr("dynhull_cli.demo.server.Popen", Process)
