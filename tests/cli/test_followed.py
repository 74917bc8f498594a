"""The states that `dynhull top` draws from: whatever its watch ends with, it ends with that."""

from collections.abc import Iterator

import pytest

from dynhull_cli.many import Followed
from dynhull_client import ManyChange


@pytest.mark.parametrize("complete", [False, True])
def test_ends_with_the_error_that_nobody_expects(complete: bool) -> None:
    def watch() -> Iterator[ManyChange]:
        yield ManyChange("state", "fleet/a")
        if complete:
            yield ManyChange("complete")
        raise ZeroDivisionError

    followed = Followed(watch())  # type: ignore[arg-type]
    followed._thread.join()
    with pytest.raises(ZeroDivisionError):
        followed.states()
