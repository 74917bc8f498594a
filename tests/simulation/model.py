"""What must hold: the model that every answer of a simulated server is compared with.

The storage reports what it has kept, in order; that is the truth. Each batch inserts one point of a parabola, named by
its x, and all points of a parabola are vertices: so an answer names the batches that it has seen.

* Acknowledged batches are in the truth when they are acknowledged, at the revision answered; refused ones never are.
* No batch is there twice, and no two of one producer have the same number.
* A read at a revision is the truth at that revision, and so is a recall.
* No answer to a later request is older than an answer that has been seen.
* There is no refusal without its reason: a fault, the end of the server, or what the truth says.
"""

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from dynhull_server.state.batch import Applied
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import Append, Create, Delete, HullRow, Record

Content = tuple[int, ...]

DELETED = 2**62


class Finding(BaseException):
    """A promise is broken. No server code takes it for a fault of its own."""


@dataclass(slots=True, eq=False)
class Truth:
    """One hull as the storage has kept it: its content at each revision, and the last number of each producer."""

    row: HullRow
    contents: list[Content] = field(default_factory=lambda: [()])
    producers: dict[str, int] = field(default_factory=dict)
    deleted: bool = False

    @property
    def revision(self) -> int:
        return len(self.contents) - 1


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


class Model:
    """Every commit and every answer, over the lives of a plan.

    Args:
        limits: the servers'.

    Attributes:
        alive: the hulls there are, by name.
        faulty: whether anything has failed in this life.
        stopping: whether the server has begun to stop.
        days: whether producers may have been forgotten.
        finding: the first promise that was broken.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.alive: dict[str, Truth] = {}
        self.faulty = self.stopping = self.days = False
        self.finding: str | None = None
        self._numbers: set[int] = set()
        self._hulls: dict[int, Truth] = {}
        self._uids: dict[str, Truth] = {}
        self._places: dict[int, tuple[Truth, int]] = {}
        self._refused: set[int] = set()
        self._floor: dict[str, tuple[int, int]] = {}
        self._attempts = self._uids_given = 0
        self._open: Counter[tuple[str, str]] = Counter()
        self._asked: Counter[tuple[str, str]] = Counter()
        self._numbered: dict[tuple[str, str, int], list[Truth]] = defaultdict(list)

    def full(self, name: str, limit: str) -> bool:
        """Whether a limit leaves no room for one more hull, or for one more point of this one."""
        if limit == "max_hulls":
            return len(self.alive) >= self._limits.max_hulls
        truth = self.alive.get(name)
        most = min(truth.row.max_points or self._limits.max_points, self._limits.max_points) if truth else 0
        return limit == "max_points" and truth is not None and len(truth.contents[-1]) >= most

    def finds(self, what: str) -> Finding:
        """A Finding, to be raised."""
        if self.finding is None:
            self.finding = what
        return Finding(what)

    def new_life(self) -> None:
        """A server starts on what has been kept: the outcome of every pending commit is decided."""
        self.faulty = self.stopping = False
        self._open.clear()
        for truth in self._hulls.values():
            self._see(truth.row.name, (truth.row.number, DELETED if truth.deleted else truth.revision))

    # What is kept

    def landed(self, changes: Sequence[Any]) -> None:
        """The storage has kept these changes."""
        for change in changes:
            match change:
                case Create():
                    self._create(change.row)
                case Append():
                    for record in change.records:
                        self._append(self._hulls[change.number], record)
                case Delete():
                    truth = self._hulls[change.number]
                    truth.deleted = True
                    del self.alive[truth.row.name]

    def _create(self, row: HullRow) -> None:
        if row.number in self._numbers:
            raise self.finds(f"the number {row.number} is given to a second hull")
        if row.name in self.alive:
            raise self.finds(f"a second hull {row.name} is made beside the first")
        self._numbers.add(row.number)
        self.alive[row.name] = self._hulls[row.number] = self._uids[row.uid] = Truth(row)

    def _append(self, truth: Truth, record: Record) -> None:
        if truth.deleted:
            raise self.finds("a batch is kept of a hull that has been deleted")
        if record.revision != truth.revision + 1:
            raise self.finds(f"revision {record.revision} is kept after revision {truth.revision}")
        attempt = int(record.inserts[0, 0])
        if attempt in self._refused:
            raise self.finds(f"batch {attempt} is kept after it was refused")
        if attempt in self._places:
            raise self.finds(f"batch {attempt} is kept twice")
        content = {*truth.contents[-1], attempt}
        for x in record.deletes[:, 0].tolist():
            if x not in content and not record.lenient:
                raise self.finds(f"batch {attempt} deletes a point that is not there")
            content.discard(int(x))
        if record.producer:
            if record.sequence != truth.producers.get(record.producer, 0) + 1 and not self.days:
                raise self.finds(f"batch {record.sequence} of {record.producer} is kept out of its turn")
            truth.producers[record.producer] = record.sequence
            self._numbered[truth.row.name, record.producer, record.sequence].append(truth)
        truth.contents.append(tuple(sorted(content)))
        self._places[attempt] = truth, record.revision

    # What is asked

    def attempt(self) -> int:
        """The x of a new batch."""
        self._attempts += 1
        return self._attempts

    def uid(self) -> str:
        """Of a new hull."""
        self._uids_given += 1
        return f"uid{self._uids_given}"

    def ask(self, name: str, *, makes: bool = False, removes: bool = False) -> Asked:
        """A client is about to send a request that may make or remove a hull."""
        floor = self._floor.get(name, (0, DELETED))
        alive = floor[1] != DELETED and not self._open[name, "delete"]
        absent = name not in self.alive and not self._open[name, "create"]
        self._count(name, makes, removes, 1)
        self._asked[name, "create"] += makes
        self._asked[name, "delete"] += removes
        deletes, creates = self._asked[name, "delete"], self._asked[name, "create"]
        return Asked(name, floor, alive and not removes, absent and not makes, deletes, creates, makes, removes)

    def _count(self, name: str, makes: bool, removes: bool, by: int) -> None:
        if makes:
            self._open[name, "create"] += by
        if removes:
            self._open[name, "delete"] += by

    def _see(self, name: str, place: tuple[int, int]) -> None:
        if place > self._floor.get(name, (0, 0)):
            self._floor[name] = place

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
            hulls = self._numbered.get((asked.name, producer, sequence), [])
            if attempt in self._places or not hulls:
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

    def exists(self, asked: Asked) -> None:
        """There is a hull of that name."""
        if asked.absent and self._asked[asked.name, "create"] == asked.creates:
            raise self.finds(f"{asked.name} was never made, and is called there")

    def content(self, uid: str, revision: int) -> Content:
        """The truth at a revision of a hull that an answer has named."""
        truth = self._uids.get(uid)
        if truth is None:
            raise self.finds(f"an answer names a hull that is not kept: {uid}")
        if not 0 <= revision <= truth.revision:
            raise self.finds(f"an answer names revision {revision} of {truth.row.name}, which is not kept")
        return truth.contents[revision]

    def read(self, asked: Asked, uid: str, revision: int, seen: Content) -> None:
        """A hull was read."""
        kept = self.content(uid, revision)
        if seen != kept:
            raise self.finds(f"revision {revision} of {asked.name} was answered as {seen}, and is kept as {kept}")
        self._answered(asked, (self._uids[uid].row.number, revision))

    def recalled(self, uid: str, revision: int, seen: Content) -> None:
        """An earlier revision was read."""
        kept = self.content(uid, revision)
        if seen != kept:
            raise self.finds(f"revision {revision} was recalled as {seen}, and is kept as {kept}")

    def last(self, asked: Asked, producer: str, sequence: int) -> None:
        """The last number of a producer was answered."""
        kept = [each.producers.get(producer, 0) for each in self._hulls.values() if each.row.name == asked.name]
        if sequence > max(kept, default=0):
            raise self.finds(f"number {sequence} of {producer} was answered, and is not kept")
