"""The quarantine beside a keyed hull: what of a batch it holds out, and what batches about it change."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from dynhull.keys import key_list

from ..admission import too_old
from ..batch import KeyedBatch
from ..errors import InvalidBatchError, KeyRepeatedError
from ..frames import Globe
from ..records import FOREVER, NO_TIME, HeldChange, HeldRows, HullSettings, KeyRows, QuarantineRules
from .judging import Plane, Sphere
from .key_rows import no_keys, of_kind, selected
from .live import AnyKeyedHull
from .quarantine import OFF, Quarantine, rows_of

if TYPE_CHECKING:
    from .deadlines import Key


@dataclass(slots=True)
class AdmittedPuts:
    """A batch without the rows that are too old.

    Attributes:
        rows: the rows.
        clock: the clock of the hull after the batch, None for a hull without a clock.
        late: the number of rows that are too old.
        clamped: the number of rows whose time was reduced.
        refuse_missing: whether a missing key among the removes refuses the batch.
        young: (n,) which puts of the batch are not too old; None if all are not.
        request: the batch if it is about the quarantine, otherwise None.
    """

    rows: KeyRows
    clock: int | None
    late: int
    clamped: int
    refuse_missing: bool
    young: npt.NDArray[np.bool_] | None = None
    request: KeyedBatch | None = None


class Verdict(NamedTuple):
    """What the quarantine adds to the result of a batch; `missing` is negative for removes that it knows."""

    held: Sequence[int] = ()
    released: int = 0
    dropped: int = 0
    stale: int = 0
    missing: int = 0


NOTHING_HELD = Verdict()


class Gate:
    """Lets positions into a keyed hull, or holds them out.

    Args:
        settings: the settings of the hull.
        rules: the rules of the quarantine; None for those of the settings.
        held: what it holds.

    Attributes:
        quarantine: the positions that break rules; None for a hull that has never had any rule.
    """

    __slots__ = ("_kind", "_settings", "quarantine")

    def __init__(self, settings: HullSettings, rules: QuarantineRules | None, held: HeldRows | None) -> None:
        assert settings.identity != "multiset"
        self._settings = settings
        self._kind = settings.identity
        rules = rules or settings.quarantine
        self.quarantine = None if rules is None else Quarantine(self._kind, rules, held)

    def expire(self, clock: int | None) -> None:
        """Drop what is too old, or whose deadline has come."""
        if self.quarantine is not None:
            self.quarantine.expire(too_old(self._settings, clock), clock)

    def opened(self, batch: KeyedBatch, globe: Globe | None) -> KeyedBatch:
        """A batch about the quarantine, with the positions that it lets in; raises InvalidBatchError."""
        if len(batch.keys) or len(batch.removes):
            problem = "a batch that releases or drops keys in quarantine, or sets its rules, has no puts and removes"
            raise InvalidBatchError(batch.field, f"{len(batch.keys) + len(batch.removes)} keys", problem)
        named: dict[Key, tuple[str, int]] = {}
        for field, keys in (("releases", batch.releases), ("drops", batch.drops)):
            for row, key in enumerate(() if keys is None else key_list(keys)):
                first = named.setdefault(key, (field, row))
                if first != (field, row):
                    raise KeyRepeatedError(key, first, (field, row))
        if self.quarantine is None or batch.releases is None:
            return batch
        found = self.quarantine.of(key for key in key_list(batch.releases) if key in self.quarantine)
        misplaced = None if globe is None else globe.refusal(found.points)
        if misplaced is not None:  # the centre has moved since
            key = key_list(found.keys)[misplaced.row]
            held = f"{key!r}, held at {misplaced.place}"
            raise InvalidBatchError("releases", held, misplaced.problem, key_list(batch.releases).index(key))
        has_times, has_deadlines = (found.times != NO_TIME).any(), (found.deadlines != FOREVER).any()
        return replace(
            batch,
            keys=found.keys,
            points=found.points,
            times=found.times if has_times or self._settings.by_event_time else None,
            deadlines=found.deadlines if has_deadlines else None,
            accuracies=found.accuracies if found.accuracies.any() else None,
        )

    def judge(
        self,
        admitted: AdmittedPuts,
        revision: int,
        hull: AnyKeyedHull,
        globe: Globe | None,
        written: Callable[[KeyRows], npt.NDArray[np.bool_]],
    ) -> Verdict:
        """Leave in a batch the rows that are let in, and what it changes in the quarantine. Drops what is too old."""
        rows, request, quarantine = admitted.rows, admitted.request, self.quarantine
        self.expire(admitted.clock)
        if request is not None:
            return self._carry_out_request(request, rows)
        assert quarantine is not None  # `apply` has asked
        if not quarantine.has_rules and not quarantine:
            return NOTHING_HELD
        frame = Plane() if globe is None else Sphere(globe.center)
        judged = quarantine.judge(rows, written(rows), hull, frame, revision)
        held = judged.held
        if held and admitted.young is not None:
            held = np.flatnonzero(admitted.young)[held].tolist()
        if not judged.let_in.all():
            rows = admitted.rows = selected(rows, judged.let_in)
        rows.held = judged.change
        return Verdict(held, judged.released, judged.dropped, judged.stale, -judged.only_held)

    def _carry_out_request(self, request: KeyedBatch, rows: KeyRows) -> Verdict:
        quarantine = self.quarantine
        wanted = [] if request.releases is None else key_list(request.releases)
        unwanted = [] if request.drops is None else key_list(request.drops)
        left = [key for key in (*wanted, *unwanted) if quarantine is not None and key in quarantine]
        rows.held = HeldChange(rows_of(no_keys(self._kind), []), of_kind(left, no_keys(self._kind)), request.rules)
        released = sum(quarantine is not None and key in quarantine for key in wanted)
        return Verdict([], released, len(left) - released, 0, len(wanted) + len(unwanted) - len(left))

    def follow(self, change: HeldChange) -> None:
        """Do what a change has done to the quarantine."""
        if self.quarantine is None:
            self.quarantine = Quarantine(self._kind, OFF)
        self.quarantine.follow(change)
