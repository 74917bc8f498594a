"""From messages to rows: which hull, which key, where, when."""

import math
from collections.abc import Iterator
from datetime import timedelta
from hashlib import sha256
from typing import Any, NamedTuple

import orjson

from dynhull_cli.reading.columns import are_degrees, available
from dynhull_cli.reading.labels import accuracy_of, key_of
from dynhull_cli.reading.nmea import position
from dynhull_cli.reading.time_forms import TimeForm
from dynhull_cli.reading.times import EPOCH, NAMES, TimeReader
from dynhull_cli.reading.values import BadValueError, coordinate, is_number

from .expressions import MISSING, Value, is_fixed, is_in_document, last_name, value_of
from .feed import Message

NMEA_MEMBERS = "lon", "lat"  # as the defaults of --x and --y have them
EARLIEST, LATEST = 1990, 2100  # years in which positions are taken


class Row(NamedTuple):
    """A position, or the end of a key; times are in microseconds since 1970."""

    hull: str
    key: Any
    x: float
    y: float
    time: int | None
    expires: int | None = None
    deletes: bool = False
    accuracy: float = 0.0


class Mapping:
    """Reads rows from messages of JSON.

    Args:
        hull: an expression for the name of the hull, see `expressions`.
        x, y: expressions for the coordinates.
        key: an expression for the key; None for points without keys.
        time: an expression for the event time; None for none.
        expires: an expression for the time at which the key leaves, if it leaves; None for none.
        accuracy: an expression for the accuracy of the position, if it has one; None for none.
        form: how times are written.
        each: a path to an array with a row in each element; None if a message is one row.
        deletes: whether a message without contents deletes its key.
        nmea: whether messages are sentences of NMEA, each with a position as good as an object with `lon` and `lat`.

    Attributes:
        hull: the hull of all messages; None if it depends on the message.
        keyed: whether rows have keys.
        degrees: whether the coordinates have the names of longitudes and latitudes.
        swapped: whether they have them the other way round.
        warning: what is odd about the first time; None if nothing is.
        digest: differs from that of any other mapping.

    Raises:
        ValueError: an expression is none.
    """

    def __init__(
        self,
        hull: str,
        x: str,
        y: str,
        key: str | None,
        time: str | None,
        expires: str | None,
        accuracy: str | None,
        form: TimeForm,
        each: str | None,
        *,
        deletes: bool = False,
        nmea: bool = False,
    ) -> None:
        self.hull = hull if is_fixed(hull) else None
        self.keyed = key is not None
        leaving = [] if expires is None else ["expires", expires]
        leaving += [] if accuracy is None else ["accuracy", accuracy]
        more = [*leaving, *_written(form), *(["delete"] if deletes else []), *(["nmea"] if nmea else [])]
        self.digest = sha256(repr((hull, x, y, key, time, str(form.unit), each, *more)).encode()).hexdigest()[:12]
        self._axes = last_name(x), last_name(y)
        self.degrees = are_degrees(*self._axes)
        self.swapped = are_degrees(last_name(y), last_name(x))
        self.warning: str | None = None
        self._timed = False  # whether there was a time already
        self._hull = value_of(hull, "--hull")
        self._x, self._y = value_of(x, "--x"), value_of(y, "--y")
        for name, text in (("x", x), ("y", y)):
            if is_fixed(text):
                raise ValueError(f"--{name} {text!r} is the same for all messages: give a path, such as '$.{name}'")
        self._key = None if key is None else value_of(key, "--key")
        self._time = None if time is None else value_of(time, "--time")
        self._expires = None if expires is None else value_of(expires, "--expires")
        self._accuracy = None if accuracy is None else value_of(accuracy, "--accuracy")
        self.times, self.ends = TimeReader("time", form), TimeReader("expires", form)
        if each is not None and not each.startswith("$"):
            raise ValueError(f"--each {each!r} is no path: it begins with $")
        self._each = None if each is None else value_of(each, "--each")
        self._deletes, self._nmea = deletes, nmea
        if nmea and each is not None:
            raise ValueError("--each is for JSON: each sentence of NMEA is a point by itself")
        if deletes:
            if key is None:
                raise ValueError("--tombstones delete is for points with keys: give --key")
            for name, text in (("hull", hull), ("key", key)):
                if is_in_document(text):
                    raise ValueError(
                        f"--{name} {text!r} is in the message, and one that deletes is empty: give {{topic}}, "
                        "{1}, ... or {key}, the key of a record of Kafka"
                    )

    def rows(self, message: Message) -> list[Row]:
        """The rows of a message; ValueError says what is wrong with it."""
        if message.payload is None and self._deletes:
            return [Row(self._name(message, None), self._key_of(message, None), math.nan, math.nan, None, deletes=True)]
        return [self._row(message, document) for document in self._documents(message)]

    def _documents(self, message: Message) -> Iterator[Any]:
        if message.payload is None:
            raise ValueError("the message is empty")
        if self._nmea:
            yield from _places(message.payload)
            return
        try:
            document = orjson.loads(message.payload)
        except orjson.JSONDecodeError as error:
            raise ValueError(f"the message is no JSON: {error}") from None
        if self._each is None:
            yield document
            return
        elements = self._each(message, document)
        if not isinstance(elements, list):
            raise ValueError("--each finds no array in the message")
        yield from elements

    def _row(self, message: Message, document: Any) -> Row:
        key, time = self._key_of(message, document), None
        if self._time is not None:
            found = _found(self._time, message, document)
            time = self.times.read(found)
            if not self._timed:
                self._timed = True
                self._look_at(found, time)
        x = coordinate(_found(self._x, message, document), "x")
        y = coordinate(_found(self._y, message, document), "y")
        place = available(self._axes, x, y)
        end, accuracy = self._end_of(message, document), self._accuracy_of(message, document)
        return Row(self._name(message, document), key, *place, time, end, accuracy=accuracy)

    def _end_of(self, message: Message, document: Any) -> int | None:
        found = None if self._expires is None else _found(self._expires, message, document)
        return None if found is None or found == "" else self.ends.read(found)

    def _accuracy_of(self, message: Message, document: Any) -> float:
        found = None if self._accuracy is None else _found(self._accuracy, message, document)
        return 0.0 if found is None or found == "" else accuracy_of(found, "accuracy")

    def _name(self, message: Message, document: Any) -> str:
        hull = self._hull(message, document)
        if hull is MISSING or hull is None:
            raise BadValueError("the hull", "is missing")
        if not isinstance(hull, str):
            raise BadValueError("the hull", "not a string", hull)
        return hull

    def _key_of(self, message: Message, document: Any) -> Any:
        if self._key is None:
            return None
        return key_of(_found(self._key, message, document), "the key")

    def _look_at(self, found: Any, time: int) -> None:
        """Warn if a number is a time of another age, in this unit."""
        unit, when = self.times.unit, EPOCH + timedelta(microseconds=time)
        if unit is not None and is_number(str(found)) and not EARLIEST <= when.year < LATEST:
            self.warning = f"time: {found} {NAMES[unit]} since 1970 are {when.isoformat()}: is --time-unit right?"


def _places(payload: bytes) -> Iterator[dict[str, float]]:
    """The positions of sentences, one a line; sentences without one are left out."""
    for line in payload.decode("latin-1").splitlines():
        found = position(line) if line.strip() else None
        if found is not None:
            yield dict(zip(NMEA_MEMBERS, found, strict=True))


def _written(form: TimeForm) -> list[str]:
    """What a form of times has that is not as usual, but for the unit."""
    zone = [] if form.zone is None else ["zone", form.zone.key, form.ambiguous]
    return zone + ([] if form.format is None else ["format", form.format])


def _found(value: Value, message: Message, document: Any) -> Any:
    found = value(message, document)
    return None if found is MISSING else found
