"""The states of many hulls, as their watchers get them."""

from dynhull.arrays import Points
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2

from ..engine.hulls import Hulls
from ..engine.live_hull import LiveHull
from ..engine.positions import Standing
from ..engine.roster import RosterEntry, RosterLimits
from ..engine.rosters import Choice
from ..engine.watch_many import ManyPart, Picture
from ..settings import Settings
from ..state.errors import HullNotFoundError
from ..state.hull_state import Counts
from .access import Rights
from .encode import FRAMES, encode_measures, encode_points
from .places import Places

# Seconds between two states of a hull, where the watcher does not say.
MANY_INTERVAL = 0.1
PICTURES = {
    Picture.BEGINS: pb.PICTURE_BEGINS,
    Picture.BEGINS_ANEW: pb.PICTURE_BEGINS_ANEW,
    Picture.COMPLETE: pb.PICTURE_COMPLETE,
}


class ManyQuotas:
    """How much one caller may watch of many hulls.

    Args:
        settings: the limits.

    Attributes:
        watches: limits the watches.
        roster: the limits on each.
    """

    def __init__(self, settings: Settings) -> None:
        # Each has a place of a streaming call before, so that in total there cannot be more than of these.
        self.watches = Places("max_many_watches", settings.max_streams, settings.max_many_watches_per_caller)
        self.roster = RosterLimits(settings.max_watched_hulls, settings.max_watched_bytes)


class HullStates:
    """The states of hulls.

    Args:
        hulls: the hulls.
        encoding: that of vertices.
        outline: whether to send vertices.
        most: the most vertices of each hull, 0 for all.
    """

    def __init__(self, hulls: Hulls, encoding: points_pb2.PointEncoding, *, outline: bool, most: int) -> None:
        self._hulls = hulls
        self._encoding = encoding
        self._outline = outline
        self._most = most

    def standings(self) -> list[Standing]:
        """How far the server is."""
        return [self._hulls.standing]

    async def encode(self, entry: RosterEntry) -> bytes:
        """The state of a hull."""
        if entry.gone:
            return name_only(entry, pb.HULL_PRESENCE_GONE)
        message = pb.WatchManyResponse()
        try:
            await self._describe(self._hulls.get(entry.name), message.hulls.add(name=entry.name))
        except HullNotFoundError:  # it has gone meanwhile
            return name_only(entry, pb.HULL_PRESENCE_GONE)
        return message.SerializeToString()

    def unchanged(self, entry: RosterEntry) -> bytes:
        """The name of a hull."""
        return name_only(entry, pb.HULL_PRESENCE_UNCHANGED)

    async def _describe(self, hull: LiveHull, now: pb.HullNow) -> None:
        counts, vertices = await hull.vertices()
        encode_counts(hull, counts, now)
        now.vertex_count = len(vertices)
        if len(vertices):
            now.measures.CopyFrom(encode_measures(await hull.measures(vertices)))
        if self._outline:
            chosen, now.error = await self._chosen(hull, counts, vertices)
            now.vertices.CopyFrom(encode_points(chosen, self._encoding))

    async def _chosen(self, hull: LiveHull, counts: Counts, vertices: Points) -> tuple[Points, float]:
        if not self._most or len(vertices) <= self._most:
            return vertices, 0.0
        return await hull.sketch(counts, vertices, self._most)


def require_many(choice: Choice, access: Rights, quotas: ManyQuotas) -> None:
    """Refuse hulls that may not all be read, those to come too, or too many names.

    Raises:
        PermissionDeniedError: one of them may not be read.
        LimitExceededError: there are too many names.
    """
    quotas.roster.require_hulls(len(choice.names))
    for name in sorted(choice.names) if choice.prefix is None else [choice.prefix]:
        access.require_read(name)


def name_only(entry: RosterEntry, presence: pb.HullPresence) -> bytes:
    """What is sent of a hull that has no state, or none that is new."""
    message = pb.WatchManyResponse()
    message.hulls.add(name=entry.name, presence=presence)
    return message.SerializeToString()


def encode_counts(hull: LiveHull, counts: Counts, now: pb.HullNow) -> None:
    """Write what is known of a hull without its vertices."""
    now.uid = hull.uid
    now.revision, now.point_count, now.held_count = counts.revision, counts.points, counts.held
    now.distinct_count = counts.distinct
    if hull.geographic:
        now.frame = FRAMES["geographic"]
    if counts.center is not None:
        now.center.longitude, now.center.latitude = counts.center
    if counts.clock is not None:
        now.clock_time.FromMicroseconds(counts.clock)
    if hull.committed is not None:
        now.commit = hull.committed.number
        now.changed_time.FromMicroseconds(hull.committed.time)


def encode_many(part: ManyPart) -> bytes:
    """The message of what is sent at once: states come as one."""
    if part.picture is None and not part.position:
        return part.states
    rest = pb.WatchManyResponse(position=part.position)
    if part.picture is not None:
        rest.picture = PICTURES[part.picture]
    return part.states + rest.SerializeToString()
