"""The fields of requests, as the command line calls them."""

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dynhull_client import InvalidRequestError

FIELDS = {
    "config.identity": "--keyed",
    "config.max_points": "--point-limit",
    "config.ordering": "--event-order",
    "config.window.max_age": "--max-age",
    "config.window.max_points": "--max-points",
    "config.window.max_skew": "--max-skew",
    "config.center": "--center",
    "config.shards": "--shards",
    "shards": "SHARDS",
    "config.quarantine.max_speed": "--max-speed",
    "config.quarantine.max_growth": "--max-growth",
    "config.quarantine.confirmations": "--confirmations",
    "quarantine.max_speed": "--max-speed",
    "quarantine.max_growth": "--max-growth",
    "quarantine.confirmations": "--confirmations",
    "config.subject_hull": "--subjects",
    "config.subject_prefix": "--subject-prefix",
    "config.other_hull": "--other-hull",
    "config.hull_area.name": "--area",
    "config.hull_area.layer": "--layer",
    "config.hull_area.without_self": "--without-self",
    "config.area": "the area",
    "config.polygon_area": "--polygon",
    "config.circle_area": "--circle",
    "config.boundary": "--boundary",
    "config.initial": "--initial",
    "config.margin": "--margin",
    "config.near_distance": "--near",
    "config.report_crosses": "--crosses",
    "config.dwell": "--dwell",
    "config.min_dwell": "--min-dwell",
    "config.confirmations": "--confirmations",
    "config.max_events": "--max-events",
    "config.max_event_age": "--max-event-age",
    "batch.puts.ttl": "--ttl",
    "batch.puts.times": "--time",
    "batch.puts.expire_times": "--expires",
    "batch.insert_times": "--time",
    "producer": "--producer",
    "consumer": "--consumer",
    "after_sequence": "--after",
    "other_name": "the other hull",
}
ROWS = {
    "batch.inserts": "point",
    "batch.deletes": "point",
    "batch.puts.keys": "key",
    "batch.puts.points": "position",
    "batch.puts.times": "time",
    "batch.puts.expire_times": "time to leave",
    "batch.insert_times": "time",
    "batch.removes": "key",
    "batch.releases": "key",
    "batch.drops": "key",
}
# In the reasons and the values.
WORDS = {
    "subject_hull": "--subjects",
    "subject_prefix": "--subject-prefix",
    "other_hull": "--other-hull",
    "hull_area": "--area",
    "without_self": "--without-self",
    "FENCE_BOUNDARY_OPEN": "open",
}
ROW = re.compile(r"\b(?:puts\.keys|removes|releases|drops) row (\d+)")


def in_options(error: "InvalidRequestError") -> str:
    """The message of an error, with options in place of the fields of the request that it names."""
    field = error.field or ""
    named = field if error.row is None else f"{field}[{error.row}]"
    message = str(error)
    shown = next(
        (each for each in (error.value, repr(error.value)) if message.startswith(f"{named} is {each}: ")), None
    )
    if shown is None:
        return message
    problem = ROW.sub(lambda row: f"key {int(row[1]) + 1}", message.removeprefix(f"{named} is {shown}: "))
    problem = re.sub("|".join(WORDS), lambda word: WORDS[word[0]], problem)
    return f"{_words(field, error.row)} is {WORDS.get(shown, shown)}: {problem}"


def _words(field: str, row: int | None) -> str:
    if row is not None and field in ROWS:
        return f"{ROWS[field]} {row + 1} of the batch"
    # A field of a message that is the value of one option is named after that option.
    found = [each for each in FIELDS if field == each or field.startswith((f"{each}.", f"{each}["))]
    option = max(found, key=len, default="")
    rest = field.removeprefix(option).lstrip(".")
    words = " ".join(filter(None, [FIELDS.get(option, ""), rest]))
    return words if row is None else f"{words}[{row}]"
