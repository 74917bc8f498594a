"""The page of one viewer: what is on it, and what it has not been sent yet."""

import asyncio
import json
import math
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .advice import about_fences, about_metrics, about_picture, about_server
from .alarm_rows import alarm_rows, raised_count
from .cards import key, past_table, table
from .degrees import disk
from .describe import describe, describe_key
from .feed import HullFeed
from .fence_picks import FencePicks
from .hub import Hub
from .looks import LOOKS, Look
from .many_cards import many_table
from .many_picks import ManyPicks
from .past_play import PastClock, PastPlay

if TYPE_CHECKING:
    from .outliers import OutlierFeed

# Text changes slower than the picture: nobody reads ten times a second.
TICKS_OF_TEXT = 5
LONGEST_MUTE = 30 * 86_400.0  # seconds
LATEST, FASTEST = 2.0**52, 1_000.0  # milliseconds since 1970; seconds in one
WHOLE_SERVER = ""  # instead of the name of a hull


@dataclass(frozen=True, slots=True)
class Shown:
    """A hull on the page."""

    feed: HullFeed
    look: Look


class Viewer:
    """One page.

    Args:
        hub: the source of the hulls.
        hulls: the hulls to begin with; None for those of the fences, or the largest one.
        fences: the fences to begin with; None for the first ones of these hulls.
        prefixes: the prefixes to begin with, all of whose hulls are shown.
        sought: the key to look for to begin with; empty for none.
        outliers: whether to begin with the outliers of the hulls.
        version: names the version of the page's scripts, which a page of another version loads.
    """

    def __init__(
        self,
        hub: Hub,
        hulls: list[str] | None,
        fences: list[str] | None,
        prefixes: Iterable[str] = (),
        sought: str = "",
        *,
        outliers: bool = False,
        version: str = "",
    ) -> None:
        self._hub = hub
        self._shown: dict[str, Shown] = {}
        self._version = version
        self._sought = sought
        self._with_outliers = outliers
        self._outliers: dict[str, OutlierFeed] = {}
        self._past: PastPlay | None = None
        self._alarm_trouble = ""
        self._doing: set[asyncio.Task[None]] = set()
        self._ticks = 0
        self._properties: dict[str, Any] = {}
        self._drawn: dict[tuple[str, str], str] = {}
        self._rows: dict[str, tuple[object, int]] = {}  # of each time line, how many rows have been sent
        self._untouched = hulls is None and not fences and not prefixes
        self._many = ManyPicks(hub)
        self._many.show(prefixes, ())
        self._fences = FencePicks(hub, fences)
        self._show(hub.hull_list.largest() if self._untouched else hulls or ())
        self._takes: Mapping[str, tuple[Callable[[object], bool], Callable[[Any], None]]] = {
            "hulls": (_are_names, self._pick_hulls),
            "fences": (_are_names, self._pick_fences),
            "prefixes": (_are_names, self._pick_prefixes),
            "sought": (_is_text, self._seek),
            "outliers": (_is_choice, self._choose_outliers),
            "verify": (_is_text, self._verify),
            "past": (_is_past, self._go_back),
            "acknowledge": (_is_alarm_at, self._acknowledge),
            "mute": (_is_mute, self._mute),
        }

    def close(self) -> None:
        """Let go of all feeds."""
        self._go_back(None)
        self._show(())
        self._many.show((), ())
        self._fences.close()

    def take(self, message: str) -> None:
        """Do what the page asks for: a JSON object with one or more of the names of `_takes`.

        Raises:
            ValueError: if it is none; then nothing is changed.
        """
        asked = json.loads(message)
        if not isinstance(asked, dict) or not asked.keys() <= self._takes.keys():
            raise ValueError(f"the page sent {message[:100]!r}: expected an object with {', '.join(self._takes)}")
        for name, value in asked.items():
            is_valid, _ = self._takes[name]
            if not is_valid(value):
                raise ValueError(
                    f"the page sent {name} {str(value)[:100]!r}: expected text, names, true or false, or a moment"
                )
        for name, value in asked.items():
            _, take = self._takes[name]
            take(value)
        self._ticks = 0  # the answer at once

    def messages(self) -> list[str]:
        """What is new since the last call, as JSON. Called ten times a second."""
        found: list[str] = []
        if self._ticks % TICKS_OF_TEXT == 0:
            self._choose()
            found += self._page({"version": self._version, **self._looks(), **self._text()})
            found += self._lines()
            found += self._said_of_past()
        self._ticks += 1
        found += self._page(self._found())
        for name, message in self._drawings():
            # All viewers are sent the same text, which a feed makes once.
            if self._drawn.get(name) is not message:
                self._drawn[name] = message
                found.append(message)
        found += self._many.messages()
        if self._past is not None:
            found += self._past.messages()
        return found

    def _page(self, properties: Mapping[str, Any]) -> Iterator[str]:
        """The properties of the page that have changed."""
        new = {name: value for name, value in properties.items() if self._properties.get(name) != value}
        self._properties |= new
        if new:
            yield json.dumps({"kind": "page", **new})

    def _drawings(self) -> Iterator[tuple[tuple[str, str], str]]:
        # Hulls first: fences may have their outlines.
        for name, shown in self._shown.items():
            for drawing in shown.feed.drawings():
                yield (drawing.kind, name), drawing.message
        for feed in self._fences.feeds:
            for kind, message in feed.messages().items():
                yield (kind, feed.name), message
        for name, outliers in self._outliers.items():
            if outliers.message is not None:
                yield ("outliers", name), outliers.message

    def _lines(self) -> Iterator[str]:
        """The new rows of the time lines."""
        lines = {name: shown.feed.time_line for name, shown in self._shown.items()}
        if self._hub.metrics is not None:
            lines[WHOLE_SERVER] = self._hub.metrics.time_line
        for name, line in lines.items():
            known, seen = self._rows.get(name, (line, 0))
            new = line.since(seen if known is line else 0)
            self._rows[name] = line, line.length
            if new["time"]:
                yield json.dumps({"kind": "lines", "hull": name, **new})

    def _pick_hulls(self, names: list[str]) -> None:
        self._untouched = False
        self._show(names)

    def _pick_fences(self, names: list[str]) -> None:
        self._fences.untouched = False
        self._fences.show(names)
        self._forget(self._shown.keys() | set(self._fences.names))

    def _pick_prefixes(self, prefixes: list[str]) -> None:
        self._untouched = False
        self._many.show(prefixes, (shown.look for shown in self._shown.values()))
        self._show(self._shown.keys())

    def _seek(self, key: str) -> None:
        self._sought = key

    def _choose_outliers(self, chosen: bool) -> None:
        self._with_outliers = chosen
        self._show_outliers()

    def _show_outliers(self) -> None:
        names = self._shown.keys() if self._with_outliers else set[str]()
        for name in self._outliers.keys() - names:
            del self._outliers[name]
            self._hub.outliers.release(name)
        for name in names - self._outliers.keys():
            self._outliers[name] = self._hub.outliers.open(name)

    def _verify(self, _: str) -> None:
        for shown in self._shown.values():
            shown.feed.verify_now()

    def _acknowledge(self, alarm_at: list[str]) -> None:
        name, hull = alarm_at
        self._begin(self._hub.alarms.acknowledge(name, hull))

    def _mute(self, muted: tuple[str, str, float]) -> None:
        self._begin(self._hub.alarms.mute(*muted))

    def _begin(self, act: Coroutine[Any, Any, str]) -> None:
        """Do something about an alarm; the page says why it could not be done."""

        async def do() -> None:
            self._alarm_trouble = await act

        task = asyncio.create_task(do())
        self._doing.add(task)
        task.add_done_callback(self._doing.discard)

    def _go_back(self, asked: Mapping[str, float] | None) -> None:
        """Show the past from a moment on, or not any more."""
        if self._past is not None:
            self._past.close()
        self._past = None
        if asked is not None:
            clock = PastClock(asked["moment"] / 1000, asked["speed"])
            self._past = PastPlay(self._hub.client, int(asked["number"]), clock)
            self._past.show(shown.feed for shown in self._shown.values())

    def _said_of_past(self) -> Iterator[str]:
        """The words and the figures of the moment that is shown, if that is past."""
        if self._past is not None:
            hulls = self._past.hulls
            rows = [(hulls[name], shown.look) for name, shown in self._shown.items() if name in hulls]
            figures = past_table(rows, area_unit=self._hub.units.area)
            yield self._past.said({"description": describe(hulls.values()), "table": figures})

    def _show(self, picked: Iterable[str]) -> None:
        names = list(dict.fromkeys(picked))[: len(LOOKS) - len(self._many.looks)]
        for name in self._shown.keys() - set(names):
            del self._shown[name]
            self._hub.hulls.release(name)
        for name in names:
            if name not in self._shown:
                taken = [*(shown.look for shown in self._shown.values()), *self._many.looks.values()]
                look = next(look for look in LOOKS if look not in taken)
                self._shown[name] = Shown(self._hub.hulls.open(name), look)
        self._show_outliers()
        if self._past is not None:
            self._past.show(shown.feed for shown in self._shown.values())
        self._forget(set(names) | set(self._fences.names))

    def _forget(self, names: set[str]) -> None:
        """What the page no longer shows, it has to be sent again when it shows it again."""
        self._drawn = {each: message for each, message in self._drawn.items() if each[1] in names}
        self._rows = {name: row for name, row in self._rows.items() if name in names | {WHOLE_SERVER}}

    def _choose(self) -> None:
        """Show what belongs to the viewer's choice, and something where there is none."""
        if self._untouched and not self._shown:
            self._show(self._hub.hull_list.largest())
        if self._fences.untouched and not self._fences.names and (fences := self._fences.some(self._shown)):
            self._fences.show(fences)
        hulls = self._fences.new_hulls()
        if hulls and (self._untouched or not self._fences.untouched):
            self._show([*self._shown, *hulls])

    def _found(self) -> dict[str, Any]:
        """Where the key is that the viewer looks for: in words, and for the picture."""
        sought = self._sought
        sightings = [(shown.feed.search.find(sought), shown) for shown in self._shown.values()] if sought else []
        words = [describe_key(sought, shown.feed, sighting) for sighting, shown in sightings]
        places = [
            [each.x, each.y, shown.look.colour, disk(each.x, each.y, each.accuracy, shown.feed.center).tolist()]
            for each, shown in sightings
            if each.present
        ]
        # With the first drawing, so that the field for keys does not move the picture later.
        keyed = any(shown.feed.followed and shown.feed.keyed for shown in self._shown.values())
        return {"sought": sought, "found": words, "places": places, "keyed": keyed}

    def _looks(self) -> dict[str, Any]:
        return {
            "hulls": [_look(name, shown.look) for name, shown in self._shown.items()],
            "fences": [_look(name, look) for name, look in self._fences.looks.items()],
            "prefixes": [_look(prefix, look) for prefix, look in self._many.looks.items()],
        }

    def _text(self) -> dict[str, Any]:
        """The words and the figures."""
        hull_list, fences = self._hub.hull_list, self._hub.fence_list
        feeds = [shown.feed for shown in self._shown.values()]
        many = [feed for feed, _ in self._many.feeds]
        connected = hull_list.error is None
        rows = ((shown.feed, shown.look) for shown in self._shown.values())
        return {
            "offered": [*(f"{prefix}*" for prefix in hull_list.prefixes()), *sorted(hull_list.by_name)],
            "offered_fences": sorted(fences.by_name),
            "banner": about_server(self._hub.address, hull_list.error)
            if hull_list.error
            else about_metrics(self._hub.metrics),
            "alarms": alarm_rows(self._hub.alarms),
            "raised": raised_count(self._hub.alarms),
            "alarm_trouble": self._alarm_trouble,
            "kept": [feed.kept.message(self._hub.address) for feed in feeds],
            "note": about_picture(self._hub.address, hull_list, feeds, self._fences.feeds, many),
            "outliers": [self._outliers[name].words for name in self._shown if name in self._outliers],
            "fence_hint": about_fences(self._hub.address, fences, shown=bool(self._fences.names)),
            "description": describe(feeds, self._fences.feeds, many),
            "many_table": many_table(self._many.feeds, connected=connected, area_unit=self._hub.units.area),
            "table": table(rows, connected=connected, area_unit=self._hub.units.area),
            "fence_table": self._fences.table(self._shown, connected=connected),
        }


def _look(name: str, look: Look) -> dict[str, Any]:
    return {"name": name, "key": key(look), "colour": look.colour, "dash": look.dash, "marker": look.marker}


def _are_names(value: object) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


def _is_choice(value: object) -> bool:
    return isinstance(value, bool)


def _is_text(value: object) -> bool:
    """Whether it is text without halves of surrogate pairs, which JavaScript's text may hold."""
    return isinstance(value, str) and not any("\ud800" <= letter <= "\udfff" for letter in value)


def _is_past(value: object) -> bool:
    """Whether it is a moment to go back to, or None for now."""
    if value is None:
        return True
    names = {"number", "moment", "speed"}
    if not isinstance(value, dict) or value.keys() != names or not all(map(_is_number, value.values())):
        return False
    return bool(0 <= value["moment"] <= LATEST and 0 <= value["speed"] <= FASTEST)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_alarm_at(value: object) -> bool:
    """Whether it is the name of an alarm and that of a hull."""
    return isinstance(value, list) and len(value) == 2 and all(map(_is_text, value))


def _is_mute(value: object) -> bool:
    """Whether it is the same, and seconds."""
    if not isinstance(value, list) or len(value) != 3 or not _is_number(value[2]):
        return False
    return _is_alarm_at(value[:2]) and bool(0 <= value[2] <= LONGEST_MUTE)
