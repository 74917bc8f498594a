"""How much of the past is kept: a segment goes only if it must, and does not stay when it must go."""

from collections.abc import Iterable, Sequence

from dynhull_server.state.records import FOREVER
from dynhull_server.storage.rows.ledger import HullRows
from dynhull_server.storage.rows.segment_rows import StoredSegment


def may_go(hulls: Iterable[HullRows], hull: HullRows, segment: StoredSegment, now: int, most_bytes: int) -> bool:
    """Whether a segment of a hull may go: it is too old or too much, or has no state, and what it follows may go, too.

    Args:
        hulls: all hulls; together they keep at most `most_bytes`, 0 for any number.
        hull, segment: the hull and its segment.
        now: the time in microseconds since 1970.
        most_bytes: see `hulls`.
    """
    place = hull.segments.index(segment)
    while True:
        if _must_go(hull, place, now):
            return True
        if hull.segments[place].begins:
            break
        if place == 0:
            return True
        place -= 1
    filed = [each for each in hulls if each.segments]
    oldest = min(each.segments[0].facts.last_time for each in filed)
    too_much = most_bytes and sum(map(_bytes, (each.segments for each in filed))) > most_bytes
    return bool(too_much and place == 0 and hull.segments[0].facts.last_time == oldest)


def all_may_stay(hulls: Iterable[HullRows], now: int, most_bytes: int) -> bool:
    """Whether nothing has to go any more, and everything can be read."""
    filed = [each for each in hulls if each.segments]
    if not all(each.segments[0].begins for each in filed):
        return False
    if most_bytes and sum(map(_bytes, (each.segments for each in filed))) > most_bytes:
        return False
    return not any(_must_go(hull, place, now) for hull in filed for place in range(len(hull.segments)))


def _must_go(hull: HullRows, place: int, now: int) -> bool:
    """Whether a segment is not to be kept: by age, by bytes, or since it does not lead to what is there now."""
    settings = hull.row.settings
    firsts = [each.first for each in hull.segments[place + 1 :]]
    firsts.append(hull.firsts[0] if hull.firsts else hull.last + 1)
    lasts = [each.last for each in hull.segments[place:]]
    if not settings.history or any(first > last + 1 for first, last in zip(firsts, lasts, strict=True)):
        return True
    too_old = settings.history != FOREVER and hull.segments[place].facts.last_time < now - settings.history
    return too_old or bool(settings.history_bytes and _bytes(hull.segments[place:]) > settings.history_bytes)


def _bytes(segments: Sequence[StoredSegment]) -> int:
    return sum(each.facts.bytes + each.facts.state_bytes for each in segments)
