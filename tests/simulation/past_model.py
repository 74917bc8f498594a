"""What must hold of the past of a hull.

* Each of its revisions that is kept is the one that was committed, batch by batch and as a whole.
* The revision as of a time is the last one committed at or before it, by a clock that does not go back.
* Of a hull that is created with a history for ever nothing is ever lost.
* A key that was erased is nowhere in it, and all else is as it was.
* A consumer of a feed is where it was last committed to be, over kills, too: so it gets each batch once.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dynhull.keys import PackedKeys
from dynhull_server.state.feed_consumers import ConsumerId, DropFeedConsumer, FedBy, FeedConsumer, PutFeedConsumer
from dynhull_server.state.records import FOREVER, HullRow, HullSettings, KeyRows, Record
from dynhull_server.storage.past import created

if TYPE_CHECKING:
    from .entities import Key
    from .quarantine_model import Waiting

# Who has numbered a batch is no part of the past.
NUMBERED = ("producer", "sequence", "may_skip")

# A key that is put and removed, and then erased.
ERASED = 7
# One that no hull ever has.
NOBODY = 99


@dataclass(slots=True, eq=False)
class PastTruth:
    """The past of one hull as the storage has kept it.

    Attributes:
        times: when each revision was committed; the first is the time of the creation.
        records: the batches of the revisions after the first.
        waiting: the positions in quarantine at each revision.
        whole: whether it was to be kept for ever from the beginning on.
        erased: the revision up to which `ERASED` was erased.
        gone: the one up to which who has erased it knows that.
    """

    times: list[int]
    whole: bool
    records: list[Record] = field(default_factory=list)
    waiting: list[dict["Key", "Waiting"]] = field(default_factory=lambda: [{}])
    erased: int = 0
    gone: int = 0

    def add(self, record: Record, time: int, waiting: dict["Key", "Waiting"]) -> None:
        """A revision has been committed."""
        self.records.append(record)
        self.times.append(time)
        self.waiting.append(waiting)

    def at(self, time: int) -> int | None:
        """The last revision committed at or before a time; None before the first."""
        return max((revision for revision, each in enumerate(self.times) if each <= time), default=None)

    def keeps(self, settings: HullSettings) -> None:
        """From now on that much is kept."""
        self.whole = self.whole and _for_ever(settings)

    def batch(self, revision: int) -> object:
        """The batch of a revision as it is kept, as `plain`."""
        return plain(self.records[revision - 1], erased=revision <= self.erased)

    def batches(self, revision: int) -> list[object]:
        """What may be read of it: what was read before `ERASED` was erased, until who has erased it knows that."""
        return [self.batch(revision), plain(self.records[revision - 1], erased=revision <= self.gone)]


class ConsumerTruths:
    """What was committed of the consumers of feeds, one after the other; None is a consumer that there is not."""

    def __init__(self) -> None:
        self._states: dict[ConsumerId, list[FeedConsumer | None]] = defaultdict(lambda: [None])

    def landed(self, change: PutFeedConsumer | DropFeedConsumer) -> None:
        """The storage has kept a change."""
        match change:
            case PutFeedConsumer(consumer):
                self._states[consumer.id].append(consumer)
            case DropFeedConsumer(ident):
                self._states[ident].append(None)

    def ask(self, ident: ConsumerId) -> int:
        """From which of its states on an answer to what is asked now may have one."""
        return len(self._states[ident]) - 1

    def since(self, ident: ConsumerId, asked: int) -> list[FeedConsumer | None]:
        """The states that an answer may have."""
        return self._states[ident][asked:]


def consumer_of(name: str, number: int) -> ConsumerId:
    """A consumer of the feed of a hull."""
    return ConsumerId(FedBy(name), f"reader {number}")


def past_of(row: HullRow) -> PastTruth:
    """The past of a new hull."""
    return PastTruth([created(row).time], _for_ever(row.settings))


def _for_ever(settings: HullSettings) -> bool:
    return settings.history == FOREVER and not settings.history_bytes


def plain(value: object, *, erased: bool = False) -> object:
    """A record in lists and numbers, to be compared, perhaps without `ERASED`; its commit is compared elsewhere."""
    if erased and isinstance(value, KeyRows):
        return _without(plain(value))
    if is_dataclass(value) and not isinstance(value, type):
        compared = [each.name for each in fields(value) if each.compare and each.name not in NUMBERED]
        return {name: plain(getattr(value, name), erased=erased) for name in compared}
    if isinstance(value, PackedKeys):
        return list(value)
    if isinstance(value, np.ndarray):
        return [repr(each) for each in (value.astype(float) if value.ndim > 1 else value).tolist()]
    return value


def _without(rows: Any) -> object:
    """A batch of keys without `ERASED`."""
    left = _left(rows["keys"])
    for name in ("keys", "points", "times", "deadlines", "accuracies"):
        rows[name] = _picked(rows[name], left)
    if rows["accuracies"] is not None and not any(map(float, rows["accuracies"])):
        rows["accuracies"] = None
    rows["removes"] = _picked(rows["removes"], _left(rows["removes"]))
    held = rows["held"]
    if held is not None:
        held["dropped"] = _picked(held["dropped"], _left(held["dropped"]))
        left = _left(held["rows"]["keys"])
        held["rows"] = {name: _picked(column, left) for name, column in held["rows"].items()}
    return rows


def _left(keys: Iterable[Any]) -> list[int]:
    return [place for place, key in enumerate(keys) if key != str(ERASED)]


def _picked(column: Any, left: list[int]) -> Any:
    return None if column is None else [column[place] for place in left]
