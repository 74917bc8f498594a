"""Steps as one HTML file that needs nothing else: a drawing to step through."""

import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from .picture import MOST_NUMBERS, places
from .steps import Point, Step, chosen

MOST_STEPS = 2000
TEMPLATE = files(__package__) / "page.html"


def write_page(path: Path, title: str, points: Sequence[Point], steps: Sequence[Step]) -> int:
    """Write an HTML page. Returns how many steps are in it."""
    shown = chosen(len(steps), MOST_STEPS)
    where = places(points)
    index = {point: i for i, point in enumerate(where)}
    data = {
        "title": title,
        "places": list(where.values()),
        "names": [f"({x!r}, {y!r})" for x, y in where],
        "count": len(steps),
        "steps": [{"number": i + 1, **_by_index(steps[i], index)} for i in shown],
    }
    # A file name may hold "</script>": no "<" may stand in the script.
    script = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    path.write_text(TEMPLATE.read_text(encoding="utf-8").replace("__DATA__", script), encoding="utf-8")
    return len(shown)


def _by_index(step: Step, index: dict[Point, int]) -> dict[str, object]:
    """A step with the number of each point instead of its coordinates; empty parts left out."""
    numbered = step.order if len(step.order) <= MOST_NUMBERS else ()
    paths = {"chain": step.chain, "discarded": step.discarded, "triple": step.triple, "tangents": step.tangents}
    values: dict[str, object] = {"caption": step.caption, "sign": step.sign}
    values |= {name: _numbers(path, index) for name, path in paths.items()}
    values |= {"hull": _numbers(step.hull, index), "order": _numbers(numbered, index)}
    values |= {"finished": [_numbers(chain, index) for chain in step.finished]}
    values |= {"groups": [_numbers(hull, index) for hull in step.groups]}
    return {name: value for name, value in values.items() if value}


def _numbers(points: Sequence[Point], index: dict[Point, int]) -> list[int]:
    return [index[point] for point in points]
