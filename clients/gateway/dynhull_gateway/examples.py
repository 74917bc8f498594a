"""Examples of requests. Those of one name go together: the hull in the path, and the body for it.

In the order of the description, creations first and deletions last, each works as it is written.
"""

from typing import Any

Examples = dict[str, Any]


def _named(**values: tuple[str, Any]) -> Examples:
    return {name: {"summary": summary, "value": value} for name, (summary, value) in values.items()}


def hulls(*names: str) -> Examples:
    """The hulls of a path."""
    return _named(**{name: (str(HULLS[name]["summary"]), name) for name in names})


HULLS = _named(
    fleet=("Keys in a plane", {"name": "fleet", "keyed": "str"}),
    ships=("Keys on the globe", {"name": "ships", "keyed": "str", "geographic": True}),
    alloy=("Points without keys: compositions and energies", {"name": "alloy"}),
    assets=("Points without keys: risks and returns", {"name": "assets"}),
    sensors=("Divided among shards", {"name": "sensors", "shards": 2}),
    last_hour=("A sliding window", {"name": "last_hour", "keyed": "str", "max_age": 3600}),
)
POINTS = _named(
    fleet=("Put keys", {"keys": ["LH400", "BA117", "AF006"], "points": [[0, 0], [4, 0], [2, 3]]}),
    ships=("Put keys on the globe", {"keys": ["ferry", "tanker"], "points": [[9.99, 53.54], [7.86, 53.99]]}),
    alloy=("Insert points", [[0, 0], [0.5, -1], [1, 0]]),
    assets=("Insert points as a batch", {"insert": [[0.1, 0.02], [0.2, 0.08], [0.3, 0.1]]}),
)
TRANSFERS = _named(
    fleet=(
        "A key changes hulls",
        {"batches": {"fleet": {"remove": ["AF006"]}, "last_hour": {"keys": ["AF006"], "points": [[2, 3]]}}},
    ),
)
SHARDS = _named(sensors=("Four shards", {"shards": 4}))
CENTER = _named(ships=("At a place", {"center": [9, 53]}))
ABOUT = _named(
    fleet=("Points", {"points": [[1, 1], [9, 9]]}),
    keys=("Keys of the hull `fleet`", {"keys": ["LH400", "BA117"]}),
)
FENCES = _named(
    yard=(
        "A polygon",
        {"name": "yard", "area": {"exterior": [[-1, -1], [5, -1], [5, 5]]}, "subjects": "fleet"},
    ),
    port=("A disk", {"name": "port", "area": {"center": [0, 0], "radius": 2}, "subjects": "fleet", "dwell": 60}),
    pack=("The hull of the others", {"name": "pack", "area": {"hull": "fleet"}, "subjects": "fleet"}),
)
PAST_FENCES = _named(
    yard=(
        "Who was in this yard?",
        {"area": {"exterior": [[-1, -1], [5, -1], [5, 5]]}, "subjects": "fleet", "start": "1"},
    ),
)
REPLACED = _named(
    yard=("A larger polygon", {"area": {"exterior": [[-2, -2], [6, -2], [6, 6]]}, "subjects": "fleet"}),
)
ALARMS = _named(
    spread=("The diameter", {"name": "spread", "hull": "fleet", "when": "diameter > 3", "clear": "diameter < 2"}),
    crowd=("Many points, and for long", {"name": "crowd", "prefix": "fleet", "when": "count > 100", "for": 30}),
    silent=("Nothing comes", {"name": "silent", "prefix": "fleet", "when": "silent 5m"}),
)
STREAMS = _named(
    fleet=(
        "A hull and a fence",
        {
            "subscriptions": {
                "hull": {"path": "/hulls/fleet/events?keys=true"},
                "yard": {"path": "/fences/yard/events?after=0"},
            }
        },
    ),
)
