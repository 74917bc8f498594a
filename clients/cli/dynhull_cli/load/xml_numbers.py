"""Coordinates in GPX and KML. GDAL takes for 0 what is no number, and reads GPX that is cut as far as it gets."""

from typing import IO
from xml.parsers import expat

from ..reading.values import plain, value_text

POINTS = {"wpt", "rtept", "trkpt"}  # of GPX
AXES = "lat", "lon"
COORDINATES = "coordinates"  # of KML


def require_numbers(name: str, file: IO[bytes], root: str) -> None:
    """Read a document to its end; ValueError where it is no XML of this kind, or a coordinate is no number.

    Args:
        name: of the document, for messages.
        file: its bytes.
        root: the name of its first element.
    """
    _Document(name, root).read(file)


class _Document:
    def __init__(self, name: str, root: str) -> None:
        self._name = name
        self._root: str | None = root  # None once it is there
        self._parts: list[str] | None = None
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text

    def read(self, file: IO[bytes]) -> None:
        try:
            self._parser.ParseFile(file)
        except expat.ExpatError as error:
            raise ValueError(f"{self._name} is not XML to its end: {error}") from None

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        local = tag.rpartition(":")[2]
        if self._root not in (None, local.lower()):
            raise ValueError(f"{self._name} is not {self._root}: its first element is {local}")
        self._root = None
        if local in POINTS:
            for axis in AXES:
                if axis in attributes:
                    self._require(axis, attributes[axis])
        elif local == COORDINATES:
            self._parts = []

    def _text(self, text: str) -> None:
        if self._parts is not None:
            self._parts.append(text)

    def _end(self, tag: str) -> None:
        if self._parts is not None and tag.rpartition(":")[2] == COORDINATES:
            for number in "".join(self._parts).replace(",", " ").split():
                self._require("a coordinate", number)
            self._parts = None

    def _require(self, what: str, text: str) -> None:
        try:
            float(plain(text))
        except ValueError:
            line = self._parser.CurrentLineNumber
            raise ValueError(f"{self._name}, line {line}: {what} is {value_text(text)}, not a number") from None
