"""The short way for the read that is asked most often: where a few points are.

The request and its response are a few bytes, which are read and written as such. Messages, checked arrays and the steps
of a read that may wait take three times as long as all of this. What this way does not take goes on to the method,
which says what is wrong: names and values that are not allowed, keys, other layers, revisions to wait for, the past.
"""

from dynhull.arrays import packed_points

from ..engine.hulls import Hulls
from ..engine.live_hull import LiveHull
from .access import Access
from .decode import BYTES_PER_POINT, NAME

# A request is the name, then points {packed}: a tag and a length before each. A length below 128 is one byte.
NAME_TAG, POINTS_TAG, PACKED_TAG = b"\x0a", b"\x1a", b"\x0a"
REVISION_TAG, SIDES_TAG = b"\x08", b"\x12"
TAGS_AND_LENGTHS = 6
LONGEST, MOST_POINTS = 127, 7
# So many beginnings of requests are known at a time: each has a name, and a number of points.
MOST_KNOWN = 1024


class _Known:
    """The beginning of requests that ask one hull for so many points, and that of the response to the last one.

    Attributes:
        live: the hull.
        name: its name.
        size: the bytes of the points.
        revision: the revision that answered last.
        head: all of that response but the sides.
    """

    __slots__ = ("head", "live", "name", "revision", "size")

    def __init__(self, live: LiveHull, size: int) -> None:
        self.live = live
        self.name = live.name
        self.size = size
        self.revision = -1
        self.head = b""


class ShortLocates:
    """Answers requests of Locate that are as short as they can be.

    Args:
        hulls: the hulls.
    """

    def __init__(self, hulls: Hulls) -> None:
        self._hulls = hulls
        self._known: dict[bytes, _Known] = {}

    def __len__(self) -> int:
        """The number of beginnings of requests that are known."""
        return len(self._known)

    def answer(self, data: bytes, access: Access) -> bytes | None:
        """The response to a request of a caller, both serialized; None if the request has to go the whole way."""
        if len(data) <= TAGS_AND_LENGTHS:
            return None
        begin = data[1] + TAGS_AND_LENGTHS
        known = self._known.get(data[:begin]) or self._learned(data, begin, access)
        if known is None or len(data) != begin + known.size or not access.may_read(known.name):
            return None
        found = known.live.now
        if found is None:
            if known.live.ended:
                del self._known[data[:begin]]
            return None
        xy = packed_points(data[begin:])
        if xy is None:
            return None
        counts, outline = found
        if counts.revision != known.revision:
            known.revision, known.head = counts.revision, _head(counts.revision, known.size // BYTES_PER_POINT)
        return known.head + outline.locate(xy).tobytes()

    def _learned(self, data: bytes, begin: int, access: Access) -> _Known | None:
        """What a request with an unknown beginning begins with; None if that is not a name and some points."""
        length, size = data[1], len(data) - begin
        name = data[2 : 2 + length]
        if not 0 < size <= MOST_POINTS * BYTES_PER_POINT or size % BYTES_PER_POINT or length > LONGEST:
            return None
        lengths = (NAME_TAG, length), (POINTS_TAG, size + 2), (PACKED_TAG, size)
        first, *others = (tag + bytes([each]) for tag, each in lengths)
        if data[:begin] != first + name + b"".join(others) or not name.isascii() or not NAME.fullmatch(name.decode()):
            return None
        if not access.may_read(name.decode()) or not self._hulls.has(name.decode()):
            return None
        live = self._hulls.get(name.decode())
        if live.geographic:
            return None
        if len(self._known) == MOST_KNOWN:
            self._known.clear()
        known = self._known[data[:begin]] = _Known(live, size)
        return known


def _head(revision: int, points: int) -> bytes:
    """All of a response but the sides of so many points."""
    if not revision:  # a field that has its default is left out
        return SIDES_TAG + bytes([points])
    number = []
    while revision > LONGEST:
        number.append(revision & LONGEST | LONGEST + 1)
        revision >>= 7
    return REVISION_TAG + bytes([*number, revision]) + SIDES_TAG + bytes([points])
