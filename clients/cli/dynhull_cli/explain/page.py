"""A story as a self-contained HTML page to step through."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path

from .scene import Mark, Position, Story, chosen

MOST_STEPS = 2000
TEMPLATE = files(__package__) / "page.html"


def write_page(path: Path, story: Story) -> int:
    """Write an HTML page. Returns the number of steps in it."""
    shown = chosen(len(story.pictures), MOST_STEPS)
    index: dict[Position, int] = {}
    steps = [
        {"number": i + 1, "caption": story.pictures[i].caption, "marks": _by_index(story.pictures[i].marks, index)}
        for i in shown
    ]
    data = {
        "title": story.title,
        "styles": {name: asdict(style) for name, style in story.styles.items()},
        "legend": story.legend,
        "low": story.low,
        "high": story.high,
        "backdrop": _by_index(story.backdrop, index),
        "count": len(story.pictures),
        "steps": steps,
        "places": list(index),
        "names": [story.names.get(position, "") for position in index],
    }
    # A file name may hold "</script>": no "<" may stand in the script.
    script = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    path.write_text(TEMPLATE.read_text(encoding="utf-8").replace("__DATA__", script), encoding="utf-8")
    return len(shown)


def _by_index(marks: Iterable[Mark], index: dict[Position, int]) -> list[list[object]]:
    """Each mark as its style, the numbers of its positions, and its text where it has one."""
    return [
        [mark.style, [index.setdefault(p, len(index)) for p in mark.positions], *([mark.text] if mark.text else [])]
        for mark in marks
    ]
