"""Writers to hulls with keys, times, windows and deadlines, and the comparison of such hulls with the model."""

import time
from collections.abc import Sequence
from itertools import chain

import numpy as np
from actors import Seen, Shared, Streamer, Watcher, Writer, persist
from pacing import pause
from patience import PATIENCE
from promises import require
from timeline import FLEETS, SECOND, Change, Contents, Entity, Key, Kind, Timeline, draw, encode, outline

from dynhull_client._messages import decode_names
from dynhull_proto.v1 import batch_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

# The greatest difference between readings of one machine's clock by two processes, in the unit of times.
SKEW = SECOND
SHUTTLE_KEYS = 40
ALL_POINTS = 100_000  # the largest sample

# Position and time of a key.
Row = tuple[float, float, int]


def wall() -> int:
    return time.time_ns() // 1000


class TimedWriter(Streamer):
    """Writes to a hull of its own, and compares what each acknowledgement says with the model."""

    several = True

    def __init__(self, shared: Shared, kind: Kind, seed: int) -> None:
        super().__init__(shared, f"writer-of-{kind.name}", (kind.name,))
        self.timelines = [Timeline(kind, self.batches, 0)]
        self.kind = kind
        self._random = np.random.default_rng(seed)
        self._sent, self._held = Contents(kind), Contents(kind)
        self._now = 10**15  # of event times that drive a clock: years ago
        self.clock: int | None = None
        self._latest: int | None = None  # of the event times acknowledged
        self._revisions = [(0, 0)]  # since the last rest: revision and number of acknowledged batches

    def create_batch(self) -> tuple[Change]:
        pause(self.shared.breath)
        self._now = wall() if self.kind.follows_server else self._now + int(self._random.integers(SECOND // 50))
        change = draw(self._random, self._sent, self._now)
        self._sent.apply(change)
        return (change,)

    def encode(self, batch: tuple[Change]) -> batch_pb2.Batch:
        return encode(self.kind, batch[0])

    def acknowledge(self, *results: batch_pb2.BatchResult) -> None:
        super().acknowledge(*results)
        change: Change = self.batches[self.acknowledged - 1][0]
        self._held.apply(change)
        times = [each.time for each in change.puts.values()]
        self._latest = max(times) if self._latest is None else max(*times, self._latest)
        if results and not results[0].duplicate:
            self._check(results[0], change)

    def _check(self, result: batch_pb2.BatchResult, change: Change) -> None:
        """The result of the last batch is that of the model."""
        where = f"{self.name}: batch {self.acknowledged}"
        clock = result.clock_time.ToMicroseconds() if result.HasField("clock_time") else None
        self._check_clock(clock, where)
        self.clock = clock
        self._revisions.append((result.revision, self.acknowledged))
        expected = len(self._held.at(clock))
        require(result.point_count == expected, f"{where}: {result.point_count} points of {expected} at {clock}")
        puts = result.inserted + result.moved + result.stale + result.late
        require(puts == len(change.puts), f"{where}: {len(change.puts)} puts, {puts} counted")
        removes = result.deleted + result.missing
        require(removes == len(change.removes), f"{where}: {len(change.removes)} removes, {removes} counted")

    def _check_clock(self, clock: int | None, where: str) -> None:
        before = self.clock
        require(before is None or (clock is not None and clock >= before), f"{where}: clock {clock} after {before}")
        if not self.kind.follows_server:
            require(clock == self._latest, f"{where}: clock {clock}, the latest event time is {self._latest}")
        elif clock is not None:
            require(clock <= wall() + SKEW, f"{where}: clock {clock} is ahead of the time")

    def rest(self, revision: int) -> None:
        """All batches are acknowledged, and the writer waits."""
        self._sent = self.timelines[0].keep(self.clock)
        self._held = Contents(self.kind, self._sent.entities)
        self._revisions = [(revision, len(self.batches))]

    def sequences_at(self, revision: int) -> range:
        """The numbers of batches that the hull may have had at a revision since the last rest."""
        known = [number for acknowledged, number in self._revisions if acknowledged <= revision]
        later = [number for acknowledged, number in self._revisions if acknowledged > revision]
        return range(max(known), min(later, default=len(self.batches) + 1)) if known else range(0)


class Shuttle(Writer):
    """Moves keys of its own between two hulls, each batch to both at once."""

    def __init__(self, shared: Shared, number: int, seed: int) -> None:
        super().__init__(shared, f"shuttle-{number}", tuple(kind.name for kind in FLEETS))
        self.timelines = [Timeline(kind, self.batches, part) for part, kind in enumerate(FLEETS)]
        self._random = np.random.default_rng(seed)
        self._sent = [Contents(kind) for kind in FLEETS]
        self._keys: list[Key] = [number * SHUTTLE_KEYS + i for i in range(SHUTTLE_KEYS)]

    def write(self, stub: HullServiceStub) -> None:
        while not self.shared.over.is_set():
            if self.acknowledged == len(self.batches):
                if not self.shared.gate.is_set():
                    return
                self.batches.append(self.create_batch())
            request = pb.ApplyTogetherRequest(producer=self.name, sequence=self.acknowledged + 1)
            for kind, change in zip(FLEETS, self.batches[self.acknowledged], strict=True):
                request.batches.add(name=kind.name, batch=encode(kind, change))
            self.acknowledge(*stub.ApplyTogether(request, timeout=10).results)

    def acknowledge(self, *results: batch_pb2.BatchResult) -> None:
        super().acknowledge(*results)
        if results:
            one, other = results
            same = one.duplicate == other.duplicate and (one.duplicate or one.revision == other.revision)
            require(same, f"{self.name}: batch {self.acknowledged} is in one hull only: {one}, {other}")

    def create_batch(self) -> tuple[Change, ...]:
        pause(self.shared.breath)
        rng = self._random
        changes = Change(), Change()
        for i in rng.permutation(len(self._keys))[: rng.integers(2, 8)]:
            key = self._keys[i]
            here = int(rng.integers(2))
            if key in self._sent[1 - here].entities:
                changes[1 - here].removes.append(key)
            x, y = rng.normal(size=2).round(1).tolist()
            changes[here].puts[key] = Entity(x + 0.0, y + 0.0)
        for contents, change in zip(self._sent, changes, strict=True):
            contents.apply(change)
        return changes

    def rest(self, _: int) -> None:
        """All batches are acknowledged, and the writer waits."""
        self._sent = [timeline.keep(None) for timeline in self.timelines]


class ModelledHull:
    """A hull whose contents are known; its writers have keys of their own each."""

    def __init__(self, shared: Shared, kind: Kind, writers: Sequence[TimedWriter | Shuttle]) -> None:
        self.kind = kind
        self._writers = writers
        self.watcher = Watcher(shared, f"watcher of {kind.name}", kind.name, keys=kind.keyed)

    def check_at_rest(self, stub: HullServiceStub, now: int) -> None:
        """All batches are acknowledged: the hull has them, its watcher follows, and all points due by `now` leave."""
        contents = self._contents({writer.name: len(writer.batches) for writer in self._writers})
        deadline = time.monotonic() + PATIENCE
        while True:
            revision, clock = self._compare(stub, contents, "at rest")
            timeless = clock is None or not self.kind.follows_server
            if timeless or contents.at(clock) == contents.at(max(clock, now)):
                break
            require(time.monotonic() < deadline, f"{self.kind.name}: points due by {now} are there at {clock}")
            pause(0.02)
        self.watcher.wait_for(revision)
        for seen in self.watcher.seen():
            if seen.revision == revision:
                right = self._is_outline(seen, contents.at(clock))
                require(right, f"{self.watcher.name}: it is not the hull at revision {revision}")
            elif self.kind.timed:
                self._check_seen(seen)
        for writer in self._writers:
            writer.rest(revision)

    def check_copy(self, stub: HullServiceStub, last: dict[str, int], where: str) -> None:
        """Another server has the first batches of each writer."""
        self._compare(stub, self._contents(last), where)

    def _contents(self, last: dict[str, int]) -> Contents:
        """After the first `last[name]` batches of each writer."""
        timelines = [(each, last[writer.name]) for writer in self._writers for each in writer.timelines]
        parts = [timeline.after(number) for timeline, number in timelines if timeline.kind is self.kind]
        return Contents(self.kind, dict(chain.from_iterable(part.entities.items() for part in parts)))

    def _compare(self, stub: HullServiceStub, contents: Contents, where: str) -> tuple[int, int | None]:
        """Keys, positions, times, vertices and their names are those of the model. Returns revision and clock."""
        where = f"{self.kind.name} {where}"
        while True:  # points may leave between two reads
            answer = persist(stub.GetHull, pb.GetHullRequest(name=self.kind.name, include_keys=True))
            revision, found = self._read(stub)
            if revision == answer.hull.revision:
                break
        hull = answer.hull
        clock = hull.clock_time.ToMicroseconds() if hull.HasField("clock_time") else None
        expected = contents.at(clock)
        rows = {key: self._row(each) for key, each in expected.items()}
        require(found == rows, f"{where}: wrong contents at {clock}: {difference(found, rows)}")
        vertices = np.frombuffer(answer.vertices.packed).reshape(-1, 2)
        seen = Seen(revision, hull.point_count, clock, vertices, decode_names(answer.vertex_keys))
        require(self._is_outline(seen, expected), f"{where}: other vertices or names at revision {revision}")
        held = persist(stub.Verify, pb.VerifyRequest(name=self.kind.name))
        require(held.equal and held.keys_equal, f"{where}: the live hull differs from Chan's recomputation")
        return revision, clock

    def _check_seen(self, seen: Seen) -> None:
        """An event of the watcher is the hull that the model has at its revision."""
        (writer,) = self._writers
        assert isinstance(writer, TimedWriter)  # nobody knows the order of several writers' batches
        numbers = writer.sequences_at(seen.revision)
        possible = [writer.timelines[0].after(number).at(seen.clock) for number in numbers]
        right = not possible or any(self._is_outline(seen, each) for each in possible)
        require(right, f"{self.watcher.name}: at revision {seen.revision} it is not the hull of batches {numbers}")

    def _is_outline(self, seen: Seen, entities: dict[Key, Entity]) -> bool:
        vertices, keys = outline(self.kind, entities)
        named = not self.kind.keyed or seen.keys == keys
        return seen.points == len(entities) and np.array_equal(seen.vertices, vertices) and named

    def _read(self, stub: HullServiceStub) -> tuple[int, dict[Key, Row]]:
        """The revision, and what there is."""
        if not self.kind.keyed:
            sample = persist(stub.SamplePoints, pb.SamplePointsRequest(name=self.kind.name, sample_size=ALL_POINTS))
            points = np.frombuffer(sample.points.packed).reshape(-1, 2).tolist()
            return sample.revision, {(x, y): (x, y, 0) for x, y in points}
        parts = persist(
            lambda request, timeout: list(stub.ReadEntities(request, timeout=timeout)),
            pb.ReadEntitiesRequest(name=self.kind.name),
        )
        found: dict[Key, Row] = {}
        for part in parts:
            keys = decode_names(part.keys)
            xy = np.frombuffer(part.positions.packed).reshape(-1, 2).tolist()
            times = np.frombuffer(part.times.packed, "<i8").tolist() if self.kind.timed else [0] * len(keys)
            found |= {key: (x, y, at) for key, (x, y), at in zip(keys, xy, times, strict=True)}
        return parts[0].revision, found

    def _row(self, entity: Entity) -> Row:
        """As the server shows it."""
        return entity.x, entity.y, entity.time if self.kind.keyed and self.kind.timed else 0


def difference(found: dict[Key, Row], expected: dict[Key, Row]) -> str:
    """A few of the keys that are missing, too many, or elsewhere."""
    keys = [key for key in {**found, **expected} if found.get(key) != expected.get(key)]
    shown = ", ".join(f"{key!r} is {found.get(key)}, not {expected.get(key)}" for key in keys[:3])
    return f"{len(keys)} keys: {shown}"
