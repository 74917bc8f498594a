import pytest


@pytest.fixture
def served(address, monkeypatch):
    """The address of a server that commands find by themselves."""
    monkeypatch.setenv("DYNHULL_ADDRESS", address)
    return address
