"""The data that the storage keeps: hulls, and the batches applied to them."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import PackedKeys

Identity = Literal["multiset", "str", "int"]
Clock = Literal["server", "data"]
Condition = Literal["absent", "present"]
Frame = Literal["plane", "geographic"]
# What makes a revision: a batch of a client, points that leave because of the time, a call of Recenter or about the
# quarantine, another division of a hull over shards; or, in the log of a shard, that its root has begun an epoch.
Cause = Literal["batch", "expiry", "recenter", "quarantine", "division", "epoch"]
Center = tuple[float, float]  # longitude and latitude in degrees
Keys = PackedKeys | npt.NDArray[np.uint64]
Times = npt.NDArray[np.int64]  # microseconds since 1970
Accuracies = npt.NDArray[np.float64]  # how far positions may be from where they really are; 0 for not at all
NO_TIME = -(2**63)
FOREVER = 2**63 - 1
# The producers in the log of a shard: the steps of its root, and the epochs that were begun.
STEPS, EPOCHS = "steps", "epochs"
# In the uids of hulls and fences that a backup has brought back: what follows is new with each copy of the data.
INCARNATION = "."


@dataclass(frozen=True, slots=True)
class Window:
    """A sliding window over the points of a hull; or, without `max_age` and `max_points`, only what times may be.

    Attributes:
        max_age: the age in microseconds at which points leave, 0 for none.
        max_points: the number of points beyond which the oldest leave, 0 for none.
        clock: what drives the clock of the hull: the server's clock, or the greatest event time.
        max_skew: microseconds by which an event time may be ahead of the server's clock, None for any number.
        clamps: whether event times further ahead are reduced to that, rather than refused.
    """

    max_age: int = 0
    max_points: int = 0
    clock: Clock = "server"
    max_skew: int | None = None
    clamps: bool = False

    @property
    def limited(self) -> bool:
        """Whether points leave because they are too old or too many."""
        return self.max_age > 0 or self.max_points > 0


@dataclass(frozen=True, slots=True)
class QuarantineRules:
    """The rules that put positions of keys into quarantine. Without a limit there is no rule.

    Attributes:
        max_speed: the speed above which a key is too fast, in units of the coordinates, or metres, a second; or None.
        max_growth: the factor above which one position would enlarge the area of the hull too much; or None.
        confirmations: the later positions consistent with a held one that let the key in, 0 for none: by hand only.
    """

    max_speed: float | None = None
    max_growth: float | None = None
    confirmations: int = 1


@dataclass(frozen=True, slots=True)
class HullSettings:
    """The settings of a hull, fixed at its creation; but for those of its history.

    Attributes:
        identity: what identifies a point: its coordinates ("multiset"), a string or an integer.
        max_points: the limit on its points, 0 for the server's own.
        window: the window over its points, or None.
        by_event_time: whether a position with an earlier event time than the stored one changes nothing.
        frame: what coordinates mean: a plane, or longitude and latitude in degrees ("geographic").
        center: the centre that a geographic hull begins with; None for its first points to choose.
        quarantine: the rules that a keyed hull begins with, or None.
        shards: the number of shards that the points are divided among; 0 for a hull that is not divided.
        shard: which of them these points belong to; None for a hull as a whole.
        generation: that of the division that a shard is of.
        history: for how many microseconds what the journal drops is kept; 0 for not at all, FOREVER for ever.
        history_bytes: how many bytes of it are kept at most, the newest; 0 for any number.
    """

    identity: Identity = "multiset"
    max_points: int = 0
    window: Window | None = None
    by_event_time: bool = False
    frame: Frame = "plane"
    center: Center | None = None
    quarantine: QuarantineRules | None = None
    shards: int = 0
    shard: int | None = None
    generation: int = 0
    history: int = 0
    history_bytes: int = 0

    @property
    def geographic(self) -> bool:
        """Whether its points are places on the globe."""
        return self.frame == "geographic"

    @property
    def divided(self) -> bool:
        """Whether these are the settings of the root of a hull over shards: it has the vertices of all shards."""
        return self.shards > 0 and self.shard is None


DEFAULT = HullSettings()


@dataclass(frozen=True, slots=True)
class HullRow:
    """A hull as stored, without its points.

    Attributes:
        number: its number, never used for another hull.
        name: its name.
        uid: distinguishes it from other hulls of its name.
        created: seconds since 1970.
        settings: its settings.
    """

    number: int
    name: str
    uid: str
    created: float
    settings: HullSettings = DEFAULT

    @property
    def restored(self) -> bool:
        """Whether a backup has brought it back, so that it may lack batches after that backup."""
        return INCARNATION in self.uid


@dataclass(slots=True)
class PointRows:
    """A change of the points of a multiset.

    Attributes:
        inserts: (n, 2) points inserted.
        deletes: (m, 2) points deleted.
        lenient: whether some of the deletes were ignored because the point was missing.
        times: (n,) times of the inserts, in a hull with a window.
    """

    inserts: Points
    deletes: Points
    lenient: bool = False
    times: Times | None = None

    def __len__(self) -> int:
        return len(self.inserts) + len(self.deletes)


@dataclass(slots=True)
class HeldRows:
    """Positions in quarantine.

    Attributes:
        keys: n keys, each once.
        points: (n, 2) their positions.
        times: (n,) the times of these, NO_TIME for none.
        deadlines: (n,) the times at which they leave, FOREVER for none.
        speeds: (n,) the speed of each, NaN if it is not too fast.
        growths: (n,) the factor by which each would enlarge the area of the hull, NaN if that is not too much.
        revisions: (n,) the revisions that have held them.
        confirmed: (n,) the positions since then that are consistent with the one before.
        accuracies: (n,) the errors of the positions.
    """

    keys: Keys
    points: Points
    times: Times
    deadlines: Times
    speeds: npt.NDArray[np.float64]
    growths: npt.NDArray[np.float64]
    revisions: npt.NDArray[np.int64]
    confirmed: npt.NDArray[np.int64]
    accuracies: Accuracies

    def __len__(self) -> int:
        return len(self.keys)


@dataclass(slots=True)
class HeldChange:
    """A change of the quarantine of a hull.

    Attributes:
        rows: positions held, instead of those of the same keys.
        dropped: keys whose held position is dropped. Before `rows`.
        rules: the rules from now on; None for the same as before.
    """

    rows: HeldRows
    dropped: Keys
    rules: QuarantineRules | None = None


@dataclass(slots=True)
class KeyRows:
    """A change of the positions of keys. Applied again to the same state, it has the same effect.

    Attributes:
        keys: n keys put.
        points: (n, 2) their positions.
        times: (n,) their times, or None.
        deadlines: (n,) the times at which they leave, or None; FOREVER for a key without one.
        condition: which keys are put: all, or only those that are absent or present.
        removes: keys removed; missing ones are ignored.
        held: what it changes in the quarantine, or None.
        accuracies: (n,) the errors of the positions, or None: 0 for all. Given as zeros they are None, so that a batch
            is the same wherever it is read from.
    """

    keys: Keys
    points: Points
    removes: Keys
    times: Times | None = None
    deadlines: Times | None = None
    condition: Condition | None = None
    held: HeldChange | None = None
    accuracies: Accuracies | None = None

    def __post_init__(self) -> None:
        if self.accuracies is not None and not self.accuracies.any():
            self.accuracies = None

    def __len__(self) -> int:
        return len(self.keys) + len(self.removes)


@dataclass(frozen=True, slots=True)
class Expiry:
    """The removal of all points with a time of `until` or earlier, and of keys whose deadline has come.

    Attributes:
        until: microseconds since 1970; None where only deadlines count.
        points: the number of points removed.
    """

    until: int | None
    points: int

    def __len__(self) -> int:
        return self.points


Rows = PointRows | KeyRows | Expiry


@dataclass(frozen=True, slots=True)
class Division:
    """How the points of a hull are divided.

    Attributes:
        shards: the number of shards.
        generation: a number that no other division of the hull has; 0 for that at its creation.
    """

    shards: int
    generation: int = 0


@dataclass(frozen=True, slots=True)
class Tally:
    """What the root of a hull over shards knows of a shard.

    Attributes:
        step: the last step in its log.
        points: the number of its points.
        distinct: the number of its different points.
    """

    step: int = 0
    points: int = 0
    distinct: int = 0


@dataclass(frozen=True, slots=True)
class Shares:
    """What a revision of a hull over shards is for its root, which has the vertices of all shards in place of points.

    Attributes:
        tallies: the shards whose logs have it, after it.
        expiry: whether points have left because of their age.
        division: how the points are divided from this revision on, the tallies being of its shards; None for as before.
    """

    tallies: dict[int, Tally]
    expiry: bool = False
    division: Division | None = None


class CommitStamp(NamedTuple):
    """The commit of a revision.

    Attributes:
        number: the number of the commit in its partition: those of later commits are greater, and what has the same was
            committed together.
        time: the time by the server's clock, in microseconds since 1970; never less than that of an earlier commit of
            the partition.
    """

    number: int
    time: int


@dataclass(slots=True)
class Record:
    """One revision of a hull.

    Attributes:
        revision: the revision.
        rows: what it changed.
        producer: the producer that numbered the batch; empty where it has no number.
        sequence: its number.
        clock: the hull's clock after it, in microseconds since 1970; None for a hull without a clock.
        center: the centre of a geographic hull, where this revision sets or moves it before its rows; otherwise None.
        may_skip: whether numbers of the producer may be skipped.
        shares: for the root of a hull over shards, otherwise None.
        cause: what made it; None where formats before 11 did not say.
        committed: its commit, once it is read from a storage; None for one of formats before 11.
    """

    revision: int
    rows: Rows
    producer: str = ""
    sequence: int = 0
    clock: int | None = None
    center: Center | None = None
    may_skip: bool = False
    shares: Shares | None = None
    cause: Cause | None = None
    committed: CommitStamp | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Create:
    """A new hull."""

    row: HullRow


@dataclass(slots=True)
class Append:
    """Batches of consecutive revisions of one hull."""

    number: int
    records: list[Record]


@dataclass(frozen=True, slots=True)
class Delete:
    """The deletion of a hull with all its batches and snapshots."""

    number: int


Change = Create | Append | Delete


@dataclass(slots=True)
class Contents:
    """The points of a hull.

    Attributes:
        points: (n, 2) points, with multiplicity.
        keys: the key of each point, ascending; None for a multiset.
        times: (n,) the time of each point; None for a hull without times, NO_TIME for a point without one.
        deadlines: (n,) the time at which each point leaves; None for a hull without deadlines, FOREVER for a point that
            has none.
        held: the positions in quarantine; None for none.
        accuracies: (n,) the errors of the positions; None where all are 0.
    """

    points: Points = field(default_factory=lambda: np.empty((0, 2)))
    keys: Keys | None = None
    times: Times | None = None
    deadlines: Times | None = None
    held: HeldRows | None = None
    accuracies: Accuracies | None = None

    def __len__(self) -> int:
        return len(self.points)


@dataclass(slots=True)
class Parts:
    """The points of a hull in parts, each made when its turn comes: all of them at once would take new memory.

    Attributes:
        count: the number of points.
        parts: some of the points each, to be read once; the quarantine is in one of them alone.
    """

    count: int
    parts: Iterable[Contents]


@dataclass(slots=True)
class Kept:
    """One hull as stored: a snapshot, and the batches after it.

    Attributes:
        revision: the revision of the contents.
        contents: the points at that revision.
        producers: the last sequence number of each producer at that revision.
        records: the batches after it, in order.
        clock: the hull's clock at that revision, in microseconds since 1970; None for a hull without a clock.
        center: the centre of a geographic hull at that revision; None if it has none so far.
        skipping: the producers whose numbers may be skipped.
        rules: the rules of the quarantine at that revision; None for those of the settings.
        tallies: what the root of a hull over shards knows of its shards at that revision.
        division: how its points are divided at that revision; None for as at its creation.
        committed: the commit of that revision; None where it is not known, and before it is read from a storage.
    """

    revision: int = 0
    contents: Contents = field(default_factory=Contents)
    producers: dict[str, int] = field(default_factory=dict)
    records: list[Record] = field(default_factory=list)
    clock: int | None = None
    center: Center | None = None
    skipping: frozenset[str] = frozenset()
    rules: QuarantineRules | None = None
    tallies: dict[int, Tally] = field(default_factory=dict)
    division: Division | None = None
    committed: CommitStamp | None = field(default=None, compare=False)

    @property
    def last_revision(self) -> int:
        """The revision after the last batch."""
        return self.records[-1].revision if self.records else self.revision

    @property
    def sequences(self) -> dict[str, int]:
        """The last sequence number of each producer after the last batch."""
        return self.producers | {each.producer: each.sequence for each in self.records if each.producer}

    def divided(self, settings: HullSettings) -> tuple[Division, dict[int, Tally]]:
        """Of a hull over shards after the last batch, how its points are divided, and what its root knows of shards."""
        division, tallies = self.division or Division(settings.shards), dict(self.tallies)
        for record in self.records:
            if record.shares is not None:
                if record.shares.division is not None:
                    division, tallies = record.shares.division, {}
                tallies |= record.shares.tallies
        return division, tallies
