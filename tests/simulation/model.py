"""What must hold: the model that every answer of a simulated server is compared with.

The storage reports what it has kept, in order; that is the truth. Each batch inserts one point of a parabola, named by
its x, and all points of a parabola are vertices: so an answer names the batches that it has seen.

* Acknowledged batches are in the truth when they are acknowledged, at the revision answered; refused ones never are.
* Of batches to several hulls all are kept by one commit, or none; and who has seen one of them sees the others.
* No batch is there twice, and no two of one producer have the same number.
* A read at a revision is the truth at that revision, and so is a recall.
* A hull on the globe has the centre of its creation, of its first points or of the last request to move it.
* No answer to a later request is older than an answer that has been seen.
* Positions are held out of a hull, and let in, as its rules say: see `quarantine_model`.
* Events of fences follow from the revisions: see `fence_model`.
* The past is what was committed: see `past_model`.
* A restored backup is taken for what there was before by nobody, least of all by writers: see `incarnation`.
* There is no refusal without its reason: a fault, the end of the server, or what the truth says.
"""

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

import numpy as np
from support.sides import Rings, hull

from dynhull_server.state.batch import Applied
from dynhull_server.state.errors import RestoredError
from dynhull_server.state.feed_consumers import DropFeedConsumer, PutFeedConsumer
from dynhull_server.state.fences.model.records import Cause, EventType
from dynhull_server.state.hull_state import Counts
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import (
    Append,
    Center,
    Create,
    Delete,
    Expiry,
    HullRow,
    KeyRows,
    PointRows,
    QuarantineRules,
    Record,
)
from dynhull_server.storage.rows.group import EraseKeys, SetHistory

from .entities import Effect, Entities, Entity, Key
from .fence_model import FENCE_CHANGES, PREFIX, UNIT, FenceModel
from .globe import FAR, GLOBE, mean, points
from .past_model import ConsumerTruths, PastTruth, past_of
from .quarantine_model import BrokenRuleError, Carried, Verdict

Content = tuple[float, ...]

# Batches to hulls with keys remove a key of their own, from here on, that nobody puts: it names the batch.
FIRST_TAG = 1_000

# The end of the names of producers whose numbers may skip.
SKIPS = "-skips"

DELETED = 2**62
# Limits that are about fences and alarms.
OF_FENCES = "max_fences", "max_fence_consumers", "max_alarms", "max_alarm_hulls"


class Finding(BaseException):
    """A promise is broken. No server code takes it for a fault of its own."""


@dataclass(slots=True, eq=False)
class Truth:
    """One hull as the storage has kept it: its content at each revision, and the last number of each producer.

    `keys` are the keys at each revision, by their x, and `entities` those that there are; of hulls without keys or
    window none.
    `attempts` are the batches of the revisions, `held` the entities at each, and `gone` why others left in it;
    `centers` are those at each revision, and `recenters` the revisions that moved the centre and are not answered;
    `requests` those about the quarantine that are not answered.
    `corners` is for fences. `since` is the number of commits when it was made.
    `bonds` are the revisions that nobody has seen and that came together with batches of other hulls.
    `restored` is whether a backup has brought it back.
    `past` is what must be read of earlier revisions.
    `expiries` are the revisions in which points only left. `moved` is between which times of the server's clock each
    revision was made, and the time of its commit.
    """

    row: HullRow
    contents: list[Content] = field(default_factory=lambda: [()])
    producers: dict[str, int] = field(default_factory=dict)
    deleted: bool = False
    restored: bool = False
    bonds: deque[tuple[int, list[int]]] = field(default_factory=deque)
    keys: list[dict[float, Key]] = field(default_factory=lambda: [{}])
    held: list[dict[Key, Entity]] = field(default_factory=lambda: [{}])
    gone: list[dict[Key, Cause]] = field(default_factory=lambda: [{}])
    attempts: list[int | None] = field(default_factory=lambda: [None])
    centers: list[Center | None] = field(init=False)
    recenters: set[int] = field(default_factory=set)
    requests: dict[int, Carried] = field(default_factory=dict)
    corners: dict[int, Rings] = field(default_factory=dict)
    since: int = 0
    entities: Entities = field(init=False)
    past: PastTruth = field(init=False)
    expiries: set[int] = field(default_factory=set)
    moved: list[tuple[float, float, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.past = past_of(self.row)
        self.entities = Entities(self.row.name, self.row.settings)
        self.centers = [self.row.settings.center]

    @property
    def timed(self) -> bool:
        return self.row.settings.identity != "multiset" or self.row.settings.window is not None

    @property
    def revision(self) -> int:
        return len(self.contents) - 1

    @property
    def center(self) -> Center | None:
        return self.centers[-1]

    def mean(self) -> Center | None:
        """The centre that all points choose; None without points."""
        content = np.array(self.contents[-1])
        return mean(self.row.name, np.column_stack((content, content**2))) if len(content) else None

    def entities_at(self, revision: int) -> dict[Key, Entity]:
        """The points at a revision."""
        if self.timed:
            return self.held[revision]
        return {x: Entity(x, y=x * x) for x in self.contents[revision]}

    def outline(self, revision: int) -> Content:
        """The vertices at a revision: all points, if they are on the parabola."""
        entities = self.held[revision].values() if self.timed else ()
        if all(entity.y == entity.x**2 for entity in entities):
            return self.contents[revision]
        places = {(int(UNIT * entity.x), int(UNIT * entity.y)): entity.x for entity in entities}
        return tuple(sorted(places[corner] for corner in hull(places)))


@dataclass(slots=True, eq=False)
class Asked:
    """What was certain about a name when something was asked."""

    name: str
    floor: tuple[int, int]
    alive: bool
    absent: bool
    deletes: int
    creates: int
    makes: bool
    removes: bool
    commits: int


class Model:
    """Every commit and every answer, over the lives of a plan.

    Args:
        limits: the servers'.

    Attributes:
        alive: the hulls there are, by name.
        faulty: whether anything has failed in this life.
        stopping: whether the server has begun to stop.
        repeats: whether numbered batches that have no answer are sent again, before their callers.
        days: whether producers may have been forgotten.
        immediate: whether commits take no time.
        forgets: whether the past of all hulls together is limited, so that of each any part may go.
        fences: the fences.
        numbers: the numbers of all hulls and fences.
        commits: how many there have been.
        latest: the time of the last one.
        consumers: those of feeds.
        wall: what the clock on the wall has when a life begins.
        clock: the server's clock, once it has begun.
        elapsed: the seconds that have passed in all lives, whatever clocks were set to.
        uids_ever: the uids that there were before a restore.
        finding: the first promise that was broken.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.alive: dict[str, Truth] = {}
        self.clock: Callable[[], float] = lambda: inf
        self.fences = FenceModel(self)
        self.numbers: set[int] = set()
        self.consumers = ConsumerTruths()
        self.uids_ever: set[str] = set()
        self.commits = self.latest = self._now = 0
        self.wall = 1e9
        self.elapsed = 0.0
        self.faulty = self.stopping = self.days = self.repeats = self.forgets = self.immediate = False
        self.finding: str | None = None
        self._hulls: dict[int, Truth] = {}
        self._uids: dict[str, Truth] = {}
        self._places: dict[int, tuple[Truth, int]] = {}
        self._refused: set[int] = set()
        self._bound: dict[int, list[int]] = {}
        self._effects: dict[int, tuple[Effect, int, Verdict | None]] = {}
        self._floor: dict[str, tuple[int, int]] = {}
        self._attempts = self._uids_given = 0
        self._sent: dict[int, tuple[int, dict[str, tuple[int, int]]]] = {}
        self._centers_asked: dict[str, set[Center | None]] = defaultdict(set)
        self._rules_asked: dict[str, set[QuarantineRules]] = defaultdict(set)
        self._open: Counter[tuple[str, str]] = Counter()
        self._asked: Counter[tuple[str, str]] = Counter()
        self._numbered: dict[tuple[str, str, int], list[Truth]] = defaultdict(list)

    def full(self, name: str, limit: str) -> bool:
        """Whether a limit leaves no room for one more hull or fence, or for one more point or consumer of this one."""
        if limit in OF_FENCES:
            return self.fences.full(name.removeprefix(PREFIX), limit, self._limits.fences)
        if limit == "max_hulls":
            return len(self.alive) >= self._limits.max_hulls
        truth = self.alive.get(name)
        most = min(truth.row.settings.max_points or self._limits.max_points, self._limits.max_points) if truth else 0
        return limit == "max_points" and truth is not None and len(truth.contents[-1]) >= most

    def finds(self, what: str) -> Finding:
        """A Finding, to be raised."""
        if self.finding is None:
            self.finding = what
        return Finding(what)

    def new_life(self) -> None:
        """A server starts on what has been kept: the outcome of every pending commit is decided.

        Hulls have changed by their last commit, or at the start, if the clock was set back.
        """
        for truth in self.alive.values():
            first, last, commit = truth.moved[-1]
            truth.moved[-1] = min(first, self.clock()), min(max(last, commit), self.clock()), commit
        self.faulty = self.stopping = False
        self.fences.new_life()
        self._open.clear()
        for truth in self._hulls.values():
            truth.past.gone = truth.past.erased
            self._see(truth.row.name, (truth.row.number, DELETED if truth.deleted else truth.revision))
        for number, fence in self.fences.ever.items():
            self._see(PREFIX + fence.row.name, (number, fence.last if fence.deleted is None else DELETED))

    def forget_answers(self) -> None:
        """A backup is restored: it lacks what may have been answered since."""
        self._floor = {}

    # What is kept

    def landed(self, changes: Sequence[Any], now: int) -> None:
        """The storage has kept these changes, by one commit at a time by the server's clock."""
        self.commits += 1
        self.latest = max(self.latest, now)
        appended: list[int | None] = []
        of_fences: list[Any] = []
        before: dict[str, tuple[Truth, int]] = {}
        created: list[str] = []
        self._now = now
        for change in changes:
            match change:
                case Create():
                    self._create(change.row)
                    created.append(change.row.name)
                case Append():
                    truth = self._hulls[change.number]
                    before[truth.row.name] = truth, truth.revision
                    appended += [self._append(truth, record) for record in change.records]
                case SetHistory() if not self._hulls[change.number].deleted:
                    self._keep_past(self._hulls[change.number], change)
                case EraseKeys() if not self._hulls[change.number].deleted:
                    self._hulls[change.number].past.erased = change.stored[0].erasure.last
                case PutFeedConsumer() | DropFeedConsumer():
                    self.consumers.landed(change)
                case Delete():
                    truth = self._hulls[change.number]
                    truth.deleted = True
                    before[truth.row.name] = truth, truth.revision
                    del self.alive[truth.row.name]
                case _ if isinstance(change, FENCE_CHANGES):
                    of_fences.append(change)
        for attempt in filter(None, appended):
            together = self._bound.get(attempt, [])
            if not set(together) <= set(appended):
                raise self.finds(f"of the batches {together} only {attempt} is kept")
            if together:
                truth, revision = self._places[attempt]
                truth.bonds.append((revision, together))
        if of_fences or self.fences.alive:
            self.fences.landed(of_fences, before, created)
        if self.fences.watched > self._limits.fences.max_alarm_hulls:
            raise self.finds(f"alarms watch {self.fences.watched} hulls")

    def _create(self, row: HullRow) -> None:
        if row.number in self.numbers:
            raise self.finds(f"the number {row.number} is given to a second hull")
        if row.name in self.alive:
            raise self.finds(f"a second hull {row.name} is made beside the first")
        self.numbers.add(row.number)
        self.alive[row.name] = self._hulls[row.number] = self._uids[row.uid] = Truth(row)
        self.alive[row.name].since = self.commits
        self.alive[row.name].moved = [(-inf, self.clock(), self._now)]
        self.alive[row.name].past.whole &= not self.forgets

    def _keep_past(self, truth: Truth, change: SetHistory) -> None:
        settings = replace(truth.row.settings, history=change.max_age, history_bytes=change.max_bytes)
        truth.row = replace(truth.row, settings=settings)
        truth.past.keeps(settings)

    def truth_of(self, number: int) -> Truth:
        """The hull with a number, as the storage has kept it."""
        return self._hulls[number]

    def truth_of_uid(self, uid: str) -> Truth:
        """The hull with a uid, as the storage has kept it."""
        if uid not in self._uids:
            raise self.finds(f"there never was a hull {uid}")
        return self._uids[uid]

    def _append(self, truth: Truth, record: Record) -> int | None:
        """Take a revision into the truth, and into its past."""
        attempt = self._revised(truth, record)
        if isinstance(record.rows, Expiry):
            truth.expiries.add(record.revision)
        first = truth.moved[-1][0] if attempt is None or self.immediate else self._sent[attempt][0]
        truth.moved.append((first, self.clock(), self._now))
        truth.past.add(record, self.latest, dict(truth.entities.quarantine.waiting))
        return attempt

    def _revised(self, truth: Truth, record: Record) -> int | None:
        """Take a revision into the truth. Returns the number of its batch, None for an expiry."""
        if truth.deleted:
            raise self.finds("a batch is kept of a hull that has been deleted")
        if record.revision != truth.revision + 1:
            raise self.finds(f"revision {record.revision} is kept after revision {truth.revision}")
        truth.attempts.append(None)
        truth.centers.append(self._center(truth, record))
        if _only_moves_center(record):
            self._recenter(truth, record)
            return None
        if isinstance(record.rows, Expiry) or _is_request(record.rows):
            self._revise(truth, record, record.rows)
            return None
        rows = record.rows
        attempt = _attempt(truth, rows)
        if attempt in self._refused:
            raise self.finds(f"batch {attempt} is kept after it was refused")
        if attempt in self._places:
            raise self.finds(f"batch {attempt} is kept twice")
        if truth.timed:
            self._revise(truth, record, rows)
        elif isinstance(rows, PointRows):
            content = {*truth.contents[-1], attempt}
            for x, _ in points(truth.row.name, rows.deletes).tolist():
                if x not in content and not rows.lenient:
                    raise self.finds(f"batch {attempt} deletes a point that is not there")
                content.discard(x)
            truth.contents.append(tuple(sorted(content)))
        if record.producer:
            last = truth.producers.get(record.producer, 0)
            in_turn = record.sequence == last + 1
            if record.producer.endswith(SKIPS):
                in_turn = record.sequence > last
            forgotten = self.days and not record.producer.endswith(SKIPS)
            if not in_turn and not forgotten:
                raise self.finds(f"batch {record.sequence} of {record.producer} is kept out of its turn")
            truth.producers[record.producer] = record.sequence
            self._numbered[truth.row.name, record.producer, record.sequence].append(truth)
        self._places[attempt] = truth, record.revision
        truth.attempts[-1] = attempt
        return attempt

    def _center(self, truth: Truth, record: Record) -> Center | None:
        """The centre after a record: as it was, or as the first points choose it, or as somebody has asked for."""
        rows, name, center = record.rows, truth.row.name, truth.center
        if isinstance(rows, Expiry) or name not in GLOBE:
            return center
        if _only_moves_center(record):
            wanted = {truth.mean() if each is None else each for each in self._centers_asked[name]}
            if record.center not in wanted:
                raise self.finds(f"{name} is moved to {record.center}, asked for was {wanted}")
            return record.center
        inserted = rows.points if isinstance(rows, KeyRows) else rows.inserts
        chosen = mean(name, points(name, inserted)) if center is None and len(inserted) else None
        if record.center != chosen:
            raise self.finds(f"revision {record.revision} of {name} is kept with the centre {record.center}: {chosen}")
        center = chosen or center
        if len(inserted) and (center == FAR or [*FAR] in inserted.tolist()):
            raise self.finds(f"revision {record.revision} of {name} has points out of the reach of {center}")
        return center

    def _recenter(self, truth: Truth, record: Record) -> None:
        """The centre of a hull is moved, and nothing else."""
        if record.clock != truth.entities.clock:
            raise self.finds(f"the clock of {truth.row.name} changes with its centre")
        truth.contents.append(truth.contents[-1])
        truth.held.append(truth.held[-1])
        truth.keys.append(truth.keys[-1])
        truth.gone.append({})
        truth.recenters.add(truth.revision)

    def _revise(self, truth: Truth, record: Record, rows: KeyRows | PointRows | Expiry) -> None:
        """A hull with keys or a window has a new revision."""
        entities = truth.entities
        match rows:
            case Expiry():
                if record.clock is None or not entities.expire(rows, record.clock):
                    raise self.finds(f"revision {record.revision} of {truth.row.name} lets others leave: {record}")
            case KeyRows():
                self._apply(truth, record, rows)
            case _:
                self._effects[_attempt(truth, rows)] = entities.apply_points(rows), len(rows.inserts), None
        if entities.clock is not None and (record.clock is None or record.clock < entities.clock):
            raise self.finds(f"the clock of {truth.row.name} goes back from {entities.clock} to {record.clock}")
        entities.clock = record.clock
        if record.clock is not None and (overdue := entities.overdue(record.clock)):
            raise self.finds(f"{overdue} are in {truth.row.name} at {record.clock}, and should have left")
        truth.held.append(dict(entities.held))
        truth.gone.append(entities.gone)
        truth.keys.append({entity.x: key for key, entity in entities.held.items()})
        truth.contents.append(tuple(sorted(truth.keys[-1])))

    def _apply(self, truth: Truth, record: Record, rows: KeyRows) -> None:
        """A batch of keys, or a request about the quarantine."""
        try:
            verdict = truth.entities.judge(rows, record.clock, record.revision)
        except BrokenRuleError as error:
            raise self.finds(f"at revision {record.revision} of {truth.row.name}: {error}") from error
        effect = truth.entities.apply(rows)
        if isinstance(verdict, Verdict):
            self._effects[_attempt(truth, rows)] = effect, len(rows.keys), verdict
            return
        truth.requests[record.revision] = verdict
        assert rows.held is not None  # it is a request
        if rows.held.rules not in (None, *self._rules_asked[truth.row.name]):
            raise self.finds(f"{truth.row.name} has the rules {rows.held.rules}, which nobody asked for")

    def overdue(self, time: int) -> list[str]:
        """The hulls that hold what should have left at a time by the server's clock."""
        return [
            name
            for name, truth in self.alive.items()
            if truth.timed and truth.entities.follows_server and truth.entities.overdue(time)
        ]

    # What is asked

    def attempt(self) -> int:
        """The x of a new batch."""
        self._attempts += 1
        return self._attempts

    def sends(self, attempt: int, time: int) -> None:
        """A batch is about to be sent, at a time by the server's clock."""
        self._sent[attempt] = time, dict(self._floor) if self.fences.alarmed else {}

    def sent(self, attempt: int | None) -> tuple[int, dict[str, tuple[int, int]]] | None:
        """When a batch was sent, and what had been seen then, by name; None for what is no batch."""
        return None if attempt is None else self._sent[attempt]

    def bind(self, attempts: list[int]) -> None:
        """These batches are applied together or not at all."""
        self._bound |= dict.fromkeys(attempts, attempts)

    def together(self, attempt: int) -> list[int]:
        """The batches that are applied together with one, itself among them; none for one that is alone."""
        return self._bound.get(attempt, [])

    def uid(self) -> str:
        """Of a new hull."""
        self._uids_given += 1
        return f"uid{self._uids_given}"

    def ask(self, name: str, *, makes: bool = False, removes: bool = False) -> Asked:
        """A client is about to send a request that may make or remove a hull."""
        floor = self._floor.get(name, (0, DELETED))
        alive = floor[1] != DELETED and not self._open[name, "delete"]
        there = name in self.alive or (name.startswith(PREFIX) and name.removeprefix(PREFIX) in self.fences.alive)
        absent = not there and not self._open[name, "create"]
        self._count(name, makes, removes, 1)
        self._asked[name, "create"] += makes
        self._asked[name, "delete"] += removes
        deletes, creates = self._asked[name, "delete"], self._asked[name, "create"]
        alive, absent = alive and not removes, absent and not makes
        return Asked(name, floor, alive, absent, deletes, creates, makes, removes, self.commits)

    def _count(self, name: str, makes: bool, removes: bool, by: int) -> None:
        if makes:
            self._open[name, "create"] += by
        if removes:
            self._open[name, "delete"] += by

    def _see(self, name: str, place: tuple[int, int]) -> None:
        if place > self._floor.get(name, (0, 0)):
            self._floor[name] = place
        for fence, last in self.fences.told(*place):
            self._see(PREFIX + fence.row.name, (fence.row.number, last))
        if place[0] not in self._hulls:
            return
        bonds = self._hulls[place[0]].bonds
        while bonds and bonds[0][0] <= place[1]:
            for other in bonds.popleft()[1]:
                truth, revision = self._places[other]
                self._see(truth.row.name, (truth.row.number, revision))

    def _answered(self, asked: Asked, place: tuple[int, int]) -> None:
        self._count(asked.name, asked.makes, asked.removes, -1)
        if place < asked.floor:
            raise self.finds(f"an answer about {asked.name} of {place} came after one of {asked.floor}")
        self._see(asked.name, place)

    # What is answered

    def created(self, asked: Asked, uid: str) -> None:
        """A hull has been made."""
        truth = self._uids.get(uid)
        if truth is None:
            raise self.finds(f"the hull {asked.name} was answered before it was kept")
        self._answered(asked, (truth.row.number, 0))

    def deleted(self, asked: Asked) -> None:
        """A hull has been removed."""
        gone = [each for each in self._hulls.values() if each.row.name == asked.name and each.deleted]
        if not gone:
            raise self.finds(f"the deletion of {asked.name} was answered before it was kept")
        self._answered(asked, (max(each.row.number for each in gone), DELETED))

    def applied(self, asked: Asked, attempt: int, applied: Applied, producer: str, sequence: int) -> None:
        """A batch has been acknowledged."""
        if applied.duplicate:
            if self.repeats and attempt in self._places:
                truth, revision = self._places[attempt]
                self._answered(asked, (truth.row.number, revision))
                return
            if attempt in self._places or not self._may_be_duplicate(asked.name, producer, sequence):
                raise self.finds(f"batch {attempt} is called a duplicate")
            self._refused.add(attempt)
            self._answered(asked, asked.floor)
            return
        place = self._places.get(attempt)
        if place is None:
            raise self.finds(f"batch {attempt} was acknowledged, and is not kept")
        truth, revision = place
        if (applied.revision, applied.points) != (revision, len(truth.contents[revision])):
            raise self.finds(f"the answer to batch {attempt}, kept as revision {revision}, is {applied}")
        if (truth.row.number, revision) == asked.floor:
            raise self.finds(f"batch {attempt} was seen before it was sent")
        self._answered(asked, (truth.row.number, revision))

    def _may_be_duplicate(self, name: str, producer: str, sequence: int) -> bool:
        """Whether a hull of that name has a batch with the number, or with a greater one if numbers may skip."""
        if producer.endswith(SKIPS):
            hulls = [each for each in self._hulls.values() if each.row.name == name]
            return any(each.producers.get(producer, 0) >= sequence for each in hulls)
        return bool(self._numbered.get((name, producer, sequence)))

    def uid_of(self, attempt: int) -> str:
        """The uid of the hull that has a batch."""
        return self._places[attempt][0].row.uid

    def require_present(self, name: str, uid: str) -> None:
        """A numbered batch of a hull with a uid was acknowledged: it is no other one, because of a restore."""
        truth = self.alive.get(name)
        if uid and truth is not None and truth.restored and truth.row.uid != uid:
            raise self.finds(f"a batch to {uid} was acknowledged by {truth.row}, which was restored")

    def unexplained(self, asked: Asked) -> None:
        """Numbers that do not say of which hull they are leave a gap in one: a restore is not the reason."""
        truth = self.alive.get(asked.name)
        if truth is not None and truth.restored and truth.row.number == asked.floor[0]:
            raise self.finds(f"a gap in {asked.name} is answered as one, and the hull was restored")

    def restored(self, asked: Asked, error: RestoredError, least: int) -> None:
        """A writer was refused as one from before a restore, which has kept a number of it, at least this one."""
        truth = self._uids.get(error.uid)
        if truth is None or not truth.restored or error.name != asked.name:
            raise self.finds(f"{error!r} was answered, and no such hull was restored")
        if not least <= error.last <= truth.producers.get(error.producer, 0):
            raise self.finds(f"{error!r} was answered, kept is {truth.producers}")

    def kept_last(self, name: str, producer: str) -> int:
        """The last number of a producer that a hull has kept."""
        return self.alive[name].producers.get(producer, 0) if name in self.alive else 0

    def put(self, attempt: int, applied: Applied, puts: int, *, timed: bool) -> None:
        """A batch of keys has been acknowledged: what it is said to have done must be what it did.

        With `timed` its rows had times or deadlines, which may have been too early.
        """
        ordered = attempt in self._places and self._places[attempt][0].row.settings.by_event_time
        if applied.duplicate:
            return
        if applied.late and not timed:
            raise self.finds(f"of batch {attempt} {applied.late} rows were late when they came")
        effect, rows, verdict = self._effects[attempt]
        held = 0 if verdict is None else verdict.held
        # A put that is older than a held position changes nothing either, and is not kept.
        stale = puts - rows - held - applied.late if ordered else 0
        said = applied.inserted, applied.moved, applied.stale - stale, applied.skipped, applied.deleted, applied.evicted
        if stale < 0 or (said, applied.late) != (effect, puts - rows - held - stale):
            raise self.finds(f"batch {attempt} is said to have done {applied}, and did {effect} of {rows} rows")
        if verdict is not None and Verdict(len(applied.held), applied.released, applied.dropped) != verdict:
            raise self.finds(f"batch {attempt} is said to have done {applied}, and did {verdict}")

    def answered_fence(self, asked: Asked, number: int, last: int) -> None:
        """An answer about a fence comes from after the event `last`."""
        self._answered(asked, (number, last))

    def asks_alarm(self, name: str, hull: str, until: int | None) -> None:
        """Somebody is about to mute an alarm for a hull until a time, or with None to acknowledge it."""
        self.fences.asked[name].add((hull, until))

    def not_raised(self, asked: Asked, hull: str) -> None:
        """An alarm is said not to be raised for a hull: there must have been a time when it was not."""
        fence = self.fences.alive.get(asked.name.removeprefix(PREFIX))
        if fence is None or asked.floor[0] != fence.row.number or hull not in fence.known:
            return
        raises = [each.sequence for each in fence.events if each.hull == hull and each.type is EventType.BEGIN]
        if fence.known[hull].raised and raises and raises[-1] <= asked.floor[1]:
            raise self.finds(f"{asked.name} is raised for {hull}, and is said not to be")

    def removed_fence(self, asked: Asked) -> None:
        """A fence has been deleted."""
        name = asked.name.removeprefix(PREFIX)
        gone = [
            number for number, fence in self.fences.ever.items() if fence.row.name == name and fence.deleted is not None
        ]
        if not gone:
            raise self.finds(f"the deletion of {asked.name} was answered before it was kept")
        self._answered(asked, (max(gone), DELETED))

    def refused(self, asked: Asked, attempts: Sequence[int] = ()) -> None:
        """Nothing of a request is done, nor ever will be."""
        for attempt in attempts:
            if attempt in self._places:
                raise self.finds(f"batch {attempt} was refused, and is kept")
            self._refused.add(attempt)
        self._count(asked.name, asked.makes, asked.removes, -1)

    def not_found(self, asked: Asked) -> None:
        """There is no hull of that name."""
        if asked.alive and self._asked[asked.name, "delete"] == asked.deletes:
            raise self.finds(f"{asked.name} is there, and was not found")

    def unsure(self, name: str, asked: Asked) -> None:
        """A request about a fence did not find a hull: there must have been a time without it."""
        truth = self.alive.get(name)
        if truth is not None and truth.since <= asked.commits and not self._open[name, "delete"]:
            raise self.finds(f"{name} is there, and was not found for {asked.name}")

    def not_watched(self, asked: Asked, hull: str) -> None:
        """An alarm is said not to watch a hull: there must have been a time when it did not."""
        fence = self.fences.alive.get(asked.name.removeprefix(PREFIX))
        if fence is not None and fence.row.number == asked.floor[0] and hull in fence.known:
            self.unsure(hull, asked)

    def fenced(self, asked: Asked) -> None:
        """A hull cannot be deleted, because a fence depends on it."""
        if not self.fences.fenced(asked.name, asked.commits):
            raise self.finds(f"no fence depends on {asked.name}, and it is called fenced")

    def exists(self, asked: Asked) -> None:
        """There is a hull of that name."""
        if asked.absent and self._asked[asked.name, "create"] == asked.creates:
            raise self.finds(f"{asked.name} was never made, and is called there")

    def _outline(self, uid: str, revision: int) -> Content:
        """The vertices at a revision of a hull that an answer has named."""
        truth = self._uids.get(uid)
        if truth is None:
            raise self.finds(f"an answer names a hull that is not kept: {uid}")
        if not 0 <= revision <= truth.revision:
            raise self.finds(f"an answer names revision {revision} of {truth.row.name}, which is not kept")
        return truth.outline(revision)

    def read(self, asked: Asked, uid: str, revision: int, seen: Content) -> None:
        """A hull was read."""
        kept = self._outline(uid, revision)
        if seen != kept:
            raise self.finds(f"revision {revision} of {asked.name} was answered as {seen}, and is kept as {kept}")
        self._answered(asked, (self._uids[uid].row.number, revision))

    def located(self, asked: Asked, uid: str, revision: int, places: Sequence[float], sides: Sequence[int]) -> None:
        """Points of the parabola with these x were located: they are vertices, or outside."""
        kept = self._outline(uid, revision)
        if sides != [0 if x in kept else -1 for x in places]:
            raise self.finds(f"at revision {revision} of {asked.name}, {kept}, the sides of {places} were {sides}")
        self._answered(asked, (self._uids[uid].row.number, revision))

    def named(self, uid: str, revision: int, seen: Sequence[float], keys: Sequence[Key]) -> None:
        """The keys of the points with these x were read."""
        kept = self._uids[uid].keys[revision]
        if list(map(kept.get, seen)) != list(keys):
            raise self.finds(f"at revision {revision} the keys of {seen} were sent as {keys}, and are {kept}")

    def recalled(self, uid: str, revision: int, seen: Content) -> None:
        """An earlier revision was read."""
        kept = self._outline(uid, revision)
        if seen != kept:
            raise self.finds(f"revision {revision} was recalled as {seen}, and is kept as {kept}")

    def centered(self, uid: str, revision: int, center: Center | None) -> None:
        """The centre was read."""
        kept = self._uids[uid].centers[revision]
        if center != kept:
            raise self.finds(f"the centre at revision {revision} was sent as {center}, and is {kept}")

    def ask_recenter(self, name: str, center: Center | None) -> Asked:
        """Another centre of a hull is asked for, None for the mean direction of its points."""
        self._centers_asked[name].add(center)
        return self.ask(name)

    def recentered(self, asked: Asked, center: Center | None, counts: Counts) -> None:
        """The centre has been moved."""
        for truth, revision in self._since(asked):
            moved = revision == counts.revision and revision in truth.recenters
            if moved and truth.centers[revision] == counts.center and center in (None, counts.center):
                truth.recenters.remove(revision)
                self._answered(asked, (truth.row.number, revision))
                return
        raise self.finds(f"{asked.name} is said to be moved to {center} by {counts}, which is not kept")

    def not_recentered(self, asked: Asked, center: Center | None) -> None:
        """A centre was refused: points are too far from it, or there are none to choose one."""
        contents = [truth.contents[revision] for truth, revision in self._since(asked)]
        reason = {None: not all(contents), FAR: any(contents)}
        if not reason.get(center):
            raise self.finds(f"{asked.name} refused the centre {center}")

    def out_of_reach(self, asked: Asked) -> None:
        """A batch was refused because of places that are too far from the centre."""
        if not any(truth.centers[revision] == FAR for truth, revision in self._since(asked)):
            raise self.finds(f"{asked.name} refused a place that it reaches")

    def _since(self, asked: Asked) -> Iterator[tuple[Truth, int]]:
        """The hulls of a name, and their revisions, that there have been since a request."""
        for number, truth in self._hulls.items():
            if truth.row.name == asked.name and number >= asked.floor[0]:
                first = asked.floor[1] if number == asked.floor[0] else 0
                yield from ((truth, revision) for revision in range(first, truth.revision + 1))

    def ask_rules(self, name: str, rules: QuarantineRules) -> None:
        """Other rules of a quarantine are asked for."""
        self._rules_asked[name].add(rules)

    def requested(self, asked: Asked, releases: set[Key], drops: set[Key], applied: Applied) -> None:
        """A request about the quarantine has been carried out."""
        for truth, revision in self._since(asked):
            carried = truth.requests.get(revision)
            if revision != applied.revision or carried is None:
                continue
            expected = carried.waited & releases, carried.waited & drops
            missing = len(releases | drops) - len(carried.released | carried.dropped)
            said = applied.released, applied.dropped, applied.missing
            if (carried.released, carried.dropped) == expected and said == (*map(len, expected), missing):
                del truth.requests[revision]
                self._answered(asked, (truth.row.number, revision))
                return
        raise self.finds(f"{asked.name} is said to have released {releases}, dropped {drops} by {applied}: not kept")

    def last(self, asked: Asked, producer: str, sequence: int) -> None:
        """The last number of a producer was answered."""
        kept = [each.producers.get(producer, 0) for each in self._hulls.values() if each.row.name == asked.name]
        if sequence > max(kept, default=0):
            raise self.finds(f"number {sequence} of {producer} was answered, and is not kept")


def tag(attempt: int, kind: str) -> Key:
    """A key that is never there: a batch that removes it can be told from others."""
    return f"{FIRST_TAG + attempt}" if kind == "str" else FIRST_TAG + attempt


def _only_moves_center(record: Record) -> bool:
    return record.center is not None and not len(record.rows)


def _is_request(rows: object) -> bool:
    """Whether it is about the quarantine: every batch of keys removes one of its own."""
    return isinstance(rows, KeyRows) and not len(rows.removes)


def _attempt(truth: Truth, rows: PointRows | KeyRows) -> int:
    """The number of a batch: in a hull with keys or a window it is in the first row to remove."""
    if isinstance(rows, KeyRows):
        return int(rows.removes[0]) - FIRST_TAG
    named = points(truth.row.name, rows.deletes if truth.timed else rows.inserts)[0, 0]
    return int(-named if truth.timed else named)
