"""The alarms that are raised, as rows of the list on the page."""

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from typing import Any

from dynhull_cli.alarms.shown import condition_text
from dynhull_client import Alarm, AlarmStatus

from .alarm_list import AlarmFeed
from .cards import number

MOST_ROWS = 100
# Of the numbers on the globe, in metres and square metres.
SIZES = {"m": (1.0, " m"), "km": (1e3, " km"), "m2": (1.0, " m²"), "km2": (1e6, " km²")}
STATES = "raised", "acknowledged", "muted", "cleared"  # in the order of the list


def alarm_rows(feeds: Iterable[AlarmFeed]) -> list[dict[str, Any]]:
    """The rows, those that nobody takes care of first, then by time; at most `MOST_ROWS`."""
    rows = [row for feed in feeds if feed.alarm is not None for row in _rows(feed, feed.alarm)]
    return sorted(rows, key=lambda row: (STATES.index(row["state"]), -row["since"]))[:MOST_ROWS]


def raised_count(feeds: Iterable[AlarmFeed]) -> int:
    """For how many hulls alarms are raised that nobody takes care of, and that are not muted."""
    statuses = (status for feed in feeds if feed.alarm is not None for status in feed.alarm.statuses)
    return sum(status.raised and _state(status) == "raised" for status in statuses)


def _rows(feed: AlarmFeed, alarm: Alarm) -> Iterator[dict[str, Any]]:
    same = {"alarm": alarm.name, "rule": condition_text(alarm), "may": not feed.forbidden}
    for status in alarm.statuses:
        if status.raised:
            since = status.since or alarm.created
            value = _value(alarm.when, status.value)
            muted = None if status.muted_until is None else _milliseconds(status.muted_until)
            shown = {"hull": status.hull, "state": _state(status), "value": value, "since": _milliseconds(since)}
            yield {**same, **shown, "muted": muted}
    for hull, at in feed.cleared.items():
        yield {**same, "hull": hull, "state": "cleared", "value": "", "since": 1000 * at, "muted": None}


def _state(status: AlarmStatus) -> str:
    if status.muted_until is not None and status.muted_until > datetime.now(UTC):
        return "muted"
    return "raised" if status.acknowledged is None else "acknowledged"


def _value(when: str, value: float) -> str:
    """A value in the unit of its rule."""
    if when.startswith("silent"):
        return f"{value:,.0f} s"
    size, unit = SIZES.get(when.rpartition(" ")[2], (1.0, ""))
    return number(value / size) + unit


def _milliseconds(time: datetime) -> float:
    return 1000 * time.timestamp()
