"""How many threads a process uses for a batch, and whether one more finds what the batch crosses."""

import os

import pytest

from dynhull_server import process
from dynhull_server.settings import Settings


@pytest.mark.parametrize(
    ("processors", "options", "expected"),
    [
        (1, {}, (1, False)),
        (2, {}, (1, True)),
        (2, {"threads": 1}, (1, False)),
        (2, {"threads": 2}, (2, False)),
        (2, {"workers": 2}, (1, False)),
        (4, {"workers": 2}, (1, True)),
        (200, {"threads": 3}, (3, False)),
    ],
)
def test_threads(
    monkeypatch: pytest.MonkeyPatch, processors: int, options: dict[str, int], expected: tuple[int, bool]
) -> None:
    found: list[tuple[int | None, bool]] = []
    monkeypatch.setattr(process, "set_threads", lambda threads, *, beside: found.append((threads, beside)))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(processors)), raising=False)
    process.share_processors(Settings.model_validate({"in_memory": True, **options}))
    assert found == [expected]


@pytest.mark.parametrize(("processors", "threads"), [(5, 4), (200, 64)])
def test_one_processor_is_left(monkeypatch: pytest.MonkeyPatch, processors: int, threads: int) -> None:
    found: list[int | None] = []
    monkeypatch.setattr(process, "set_threads", lambda threads, *, beside: found.append(threads))  # noqa: ARG005
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(processors)), raising=False)
    process.share_processors(Settings.model_validate({"in_memory": True}))
    assert found == [threads]
