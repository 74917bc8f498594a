"""Points of the log of a GPS receiver, in sentences of NMEA 0183."""

from ..reading.nmea import position
from .chunks import CHUNK_ROWS, LINE, Chunks, Position, cut, picked
from .source import Source


def read_nmea(source: Source) -> Chunks:
    """Chunks of points from the sentences that have positions; the others are left out, and are no bad rows."""
    source.in_degrees()
    lines = ((number, line.decode("latin-1").strip()) for number, line in enumerate(source.file, start=1))
    for rows in cut(((number, line) for number, line in lines if line), CHUNK_ROWS):
        yield picked(LINE, rows, _positions)


def _positions(line: str) -> list[Position]:
    found = position(line)
    return [] if found is None else [found]
