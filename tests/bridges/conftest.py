"""What the tests of bridges share."""

from collections.abc import Iterator

import pytest
from receiver import Receiver, receiver


@pytest.fixture
def endpoint() -> Iterator[Receiver]:
    """An HTTP endpoint that events arrive at."""
    with receiver() as running:
        yield running
