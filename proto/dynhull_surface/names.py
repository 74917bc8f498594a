"""What the fields of a request are called on every way to the server: one table, by their paths on the wire."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from .described import described
from .settings import FenceSettings, HullSettings


class Name(NamedTuple):
    """The names of a field.

    Attributes:
        json: the way to it in a body over HTTP; as the last part of its path unless given, empty for the whole body.
        option: the option of commands; the last part of `json` as an option unless given.
        row: what commands call one of its rows, if it has rows.
        argument: the argument of the SDK; the way to it in a body unless given.
    """

    json: tuple[str, ...] | None = None
    option: str | None = None
    row: str = ""
    argument: str | None = None


MOMENTS = "revision", "time"
# Fields below one that is named here belong to it.
NAMES: Mapping[str, Name] = {
    **{
        f"config.{each.path}": Name((each.name,), each.option)
        for settings in (HullSettings, FenceSettings)
        for each in described(settings)
    },
    "config": Name((), ""),
    "config.window": Name((), "--max-age or --max-points", argument="max_age"),
    "config.history": Name(("history",), "--history"),
    "config.history.max_age": Name(("history",), "--history"),
    "config.history.max_bytes": Name(("history_bytes",), "--history-bytes"),
    "history": Name(("history",), "HISTORY"),
    "history.max_age": Name(("history",), "HISTORY"),
    "history.max_bytes": Name(("history_bytes",), "--history-bytes"),
    "config.quarantine": Name(option=""),
    "config.quarantine.max_speed": Name(("quarantine", "max_speed")),
    "config.quarantine.max_growth": Name(("quarantine", "max_growth")),
    "config.quarantine.confirmations": Name(("quarantine", "confirmations")),
    "config.hull_area": Name(("area",)),
    "config.hull_area.name": Name(("area", "hull"), "--area", argument="area"),
    "config.area": Name(("area",), "the area"),
    "config.polygon_area": Name(("area",), "--polygon"),
    "config.circle_area": Name(("area",), "--circle"),
    "config.subject_hull": Name(("subjects",)),
    "config.subject_prefix": Name(argument="subjects"),
    "config.other_hull": Name(),
    "config.expected": Name(row="key"),
    "rule": Name((), ""),
    "rule.hull": Name(),
    "rule.prefix": Name(),
    "rule.when": Name(),
    "rule.clear": Name(),
    "rule.hold": Name(("for",), "--for", argument="for_"),
    "rule.max_events": Name(),
    "rule.max_event_age": Name(),
    "mute_time": Name(("until",), "SPAN"),
    "quarantine": Name((), ""),
    "quarantine.max_speed": Name(argument="quarantine.max_speed"),
    "quarantine.max_growth": Name(argument="quarantine.max_growth"),
    "quarantine.confirmations": Name(argument="quarantine.confirmations"),
    "shards": Name(option="SHARDS"),
    "batch": Name((), ""),
    "batch.inserts": Name(("insert",), row="point"),
    "batch.insert_times": Name(("times",), "--time", "time"),
    "batch.deletes": Name(("delete",), row="point"),
    "batch.moves": Name(("move",)),
    "batch.moves.origins": Name(("move", "origins"), row="point", argument="move[0]"),
    "batch.moves.destinations": Name(("move", "destinations"), row="point", argument="move[1]"),
    "batch.puts": Name((), ""),
    "batch.puts.keys": Name(row="key"),
    "batch.puts.points": Name(row="position"),
    "batch.puts.times": Name(option="--time", row="time"),
    "batch.puts.expire_times": Name(option="--expires", row="time to leave"),
    "batch.puts.accuracies": Name(option="--accuracy", row="accuracy"),
    "batch.puts.ttl": Name(),
    "batch.puts.condition": Name(("only",)),
    "batch.removes": Name(("remove",), row="key"),
    "batch.releases": Name(("release",), row="key"),
    "batch.drops": Name(("drop",), row="key"),
    "batch.missing_points": Name(("missing",), "--missing-ok"),
    "batch.missing_keys": Name(("missing",), "--missing-ok"),
    "producer": Name(("Idempotency-Key",), "--producer", argument="producer"),
    "sequence": Name(("Idempotency-Key",), "", argument="sequence"),
    "consumer": Name(),
    "after_sequence": Name(("after",)),
    "after_revision": Name(("after",)),
    **{f"at_{kind}": Name(("at",), argument="when") for kind in MOMENTS},
    **{f"start_{kind}": Name(("from",), argument="start") for kind in MOMENTS},
    **{f"end_{kind}": Name(("to",), argument="end") for kind in MOMENTS},
    "other_name": Name(("other",), "the other hull"),
    "include_keys": Name(("keys",)),
    "layer_count": Name(("count",), argument="k"),
    "sample_size": Name(("size",)),
}
# What is below an area, as a body over HTTP has it; other fields, such as the encodings of points, are in no body.
IN_AREA = {"exterior": "exterior", "holes": "holes", "center_x": "center", "center_y": "center", "radius": "radius"}
PART = re.compile(r"\w+|\[\d+\]")


class Found(NamedTuple):
    """A field that is named, and what of a path is below it: names of fields and numbers of rows."""

    path: str
    name: Name
    below: tuple[str, ...]

    @property
    def json(self) -> tuple[str | int, ...]:
        """The way to it in a body over HTTP."""
        way = self.name.json if self.name.json is not None else (self.path.rpartition(".")[2],)
        below = (int(each[1:-1]) if each.startswith("[") else IN_AREA.get(each) for each in self.below)
        return (*way, *(each for each in below if each is not None))

    @property
    def argument(self) -> str:
        """The argument of the SDK, and what is below it; the path for none."""
        way = self.name.json if self.name.json is not None else (self.path.rpartition(".")[2],)
        name = ".".join(way) if self.name.argument is None else self.name.argument
        below = "".join(each if each.startswith("[") else f".{each}" for each in self.below)
        return f"{name or self.path}{below}"

    @property
    def option(self) -> str:
        """The option of commands; the path for none."""
        if self.name.option is not None:
            return self.name.option or self.path
        way = self.name.json or (self.path.rpartition(".")[2],)
        return f"--{way[-1].replace('_', '-')}"


def find(path: str) -> Found | None:
    """The names of the field with a path as the server names it, or of the nearest field above; None for none."""
    parts = PART.findall(path)
    for most in range(len(parts), 0, -1):
        above = ".".join(parts[:most])
        if above in NAMES:
            return Found(above, NAMES[above], tuple(parts[most:]))
    return None
