"""Points with keys."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np
import numpy.typing as npt

from dynhull import DuplicateKeyError, GeoKeyedHull, KeyedHull, KeyedLoader, PackedHull, Put
from dynhull.arrays import Points
from dynhull.keys import key_list

from ..admission import GREATEST_TIME, Admission, admit, server_clock, shown, too_old
from ..batch import NO_POINTS, Applied, Batch, KeyedBatch
from ..errors import InvalidBatchError, KeyMissingError, KeyRepeatedError, LimitExceededError, MisfitError
from ..frames import Globe
from ..records import (
    FOREVER,
    NO_TIME,
    Accuracies,
    Cause,
    Center,
    Contents,
    Expiry,
    HeldRows,
    HullSettings,
    KeyRows,
    Keys,
    Parts,
    QuarantineRules,
    Record,
    Times,
)
from .accuracies import NO_ACCURACIES, given_accuracies
from .deadlines import NO_DEADLINES, Key, given_deadlines
from .gate import NOTHING_HELD, AdmittedPuts, Gate
from .joining import in_one
from .key_rows import (
    key_at,
    library_times,
    merged,
    no_keys,
    of_kind,
    refuse_repeated,
    selected,
    stored_times,
    update,
)
from .live import REPLAYED_TOGETHER, AnyKeyedHull
from .mirror import Mirror
from .places import move_center, require_puts
from .quarantine import Quarantine

# Keys whose deadline has come are removed in parts of this size: reading a list of keys keeps other threads waiting.
REMOVED_TOGETHER = 8192
# Keys that are loaded at once: for each of them the loader needs memory, which is new where it was not used before.
LOADED_TOGETHER = 2**15
# Beyond twice the number of keys, deadlines and accuracies of keys that have left are dropped.
MOST_SPARE = 1024
KINDS = {"str": "strings", "int": "integers"}
NOTHING_PUT = Put(0, 0, 0, 0, 0)


@dataclass(slots=True)
class Found:
    """The positions of keys.

    Attributes:
        points: (n, 2) the position of each key; NaN for a missing key.
        present: (n,) which keys are there.
        times: (n,) their times, NO_TIME for a key without one; None for a hull without times.
        accuracies: (n,) the errors of the positions; None where all are 0.
    """

    points: Points
    present: npt.NDArray[np.bool_]
    times: Times | None
    accuracies: Accuracies | None


class Keyed:
    """The contents of a keyed hull, with or without a window. `build` comes before all but `replay`.

    Args:
        settings: the settings of the hull.
        stored: its points; those of a hull of the plane need not be there at once.
        clock: its clock.
        most_points: the limit on the number of points.
        globe: the frame of a geographic hull; None for a plane.
        rules: the rules of the quarantine; None for those of the settings.

    Attributes:
        timed: whether its points have times.
        mirror: the keys of a geographic hull in the plane, while fences compare them.
        ended: the keys whose deadline had come when points last left.
    """

    __slots__ = (
        "_accuracies",
        "_deadlines",
        "_earliest",
        "_gate",
        "_kind",
        "_loader",
        "_most_points",
        "_settings",
        "clock",
        "ended",
        "follows_server",
        "globe",
        "hull",
        "mirror",
        "timed",
    )

    def __init__(
        self,
        settings: HullSettings,
        stored: Parts,
        clock: int | None,
        most_points: int,
        globe: Globe | None,
        rules: QuarantineRules | None = None,
    ) -> None:
        assert settings.identity != "multiset"
        self._settings = settings
        self._kind = settings.identity
        self._most_points = most_points
        self.clock = clock
        self.globe = globe
        self.hull: AnyKeyedHull
        self._loader: KeyedLoader | None = None
        if globe is None:
            self._loader = KeyedHull.loader(self._kind, ordered=settings.by_event_time, room=stored.count)
        else:
            self.hull = GeoKeyedHull(self._kind, ordered=settings.by_event_time, center=globe.center)
        self.follows_server = settings.window is None or settings.window.clock == "server"
        self.mirror: Mirror | None = None
        self._deadlines, self._accuracies = NO_DEADLINES, NO_ACCURACIES
        self.ended: Sequence[Key] = ()
        self._earliest: int | None = None  # no point has an earlier time
        self.timed = settings.window is not None or settings.by_event_time
        held = self._load(stored)
        self._gate = Gate(settings, rules, held)

    @property
    def quarantine(self) -> Quarantine | None:
        """The positions that break rules; None for a hull that has never had any rule."""
        return self._gate.quarantine

    @property
    def due(self) -> int | None:
        """The time by the server's clock before which no point leaves; None if that clock makes none leave."""
        if not self.follows_server:
            return None
        window = self._settings.window
        first = self._deadlines.first
        if window is None or not window.max_age or self._earliest is None:
            return first
        oldest = self._earliest + window.max_age
        return oldest if first is None else min(first, oldest)

    def admit(self, batch: Batch | KeyedBatch, arrived: int) -> AdmittedPuts:
        """The batch with the times of its rows, without those that are too old."""
        if isinstance(batch, KeyedBatch):
            if batch.kind != self._kind:
                raise MisfitError(batch.field, f"has keys that are {KINDS[self._kind]}, not {KINDS[batch.kind]}")
        elif len(batch.inserts) or len(batch.deletes):
            field = "inserts" if len(batch.inserts) else "deletes"
            raise MisfitError(field, f"has keys, which are {KINDS[self._kind]}: a batch puts and removes them")
        else:  # empty
            batch = KeyedBatch(self._kind, no_keys(self._kind), NO_POINTS, no_keys(self._kind))
        held, quarantine = batch.of_quarantine, self._gate.quarantine
        if held:
            batch = self._gate.opened(batch, self.globe)
        columns = batch.keys, batch.points, batch.removes, batch.times, batch.deadlines, batch.condition
        rows = KeyRows(*columns, accuracies=batch.accuracies)
        puts = len(batch.keys)
        admission = admit(self._settings, batch.times, puts, "puts.times", arrived, self.clock, held=held)
        rows.times = admission.times
        if rows.times is None and quarantine is not None and quarantine.rules.max_speed is not None:
            rows.times = np.full(len(rows.keys), arrived, np.int64)
        if self.clock is not None or batch.ttl is not None or batch.deadlines is not None:
            self._admit_deadlines(batch, rows, admission, arrived)
        if self.globe is not None:
            require_puts(self.globe, batch.points, admission.young)
        late = 0
        if admission.young is not None:
            refuse_repeated(rows)
            if not held:  # a released position that has just become too old is missing
                late = len(rows.keys) - int(np.count_nonzero(admission.young))
            rows = selected(rows, admission.young)
        admitted = AdmittedPuts(rows, admission.clock, late, admission.clamped, batch.refuse_missing, admission.young)
        if held:
            admitted.request = batch
        waiting = 0 if quarantine is None else len(quarantine)
        if len(self.hull) + waiting + len(rows.keys) > self._most_points:
            self._refuse_growth(admitted)
        return admitted

    def check(self, admitted: AdmittedPuts) -> None:
        """Raise KeyRepeatedError or KeyMissingError if `apply` would."""
        refuse_repeated(admitted.rows)
        if admitted.refuse_missing:
            there = self._there(admitted.rows.removes, admitted.clock)
            if self.quarantine is not None:
                there |= np.array([key in self.quarantine for key in key_list(admitted.rows.removes)], np.bool_)
            if not there.all():
                row = int(np.argmin(there))
                raise KeyMissingError(row, key_at(admitted.rows.removes, row))

    def expires_before(self, admitted: AdmittedPuts) -> int | None:
        """The clock that the batch leads to, if points leave at that time; None if none do."""
        clock = admitted.clock
        if clock is None:
            return None
        first, until = self._deadlines.first, too_old(self._settings, clock)
        ends = first is not None and first <= clock
        old = until is not None and self._earliest is not None and self._earliest <= until
        return clock if ends or old else None

    def apply(self, admitted: AdmittedPuts, revision: int) -> Applied:
        """Apply the batch, or raise KeyRepeatedError or KeyMissingError."""
        rows, hull = admitted.rows, self.hull
        judged = self._gate.quarantine is not None or admitted.request is not None
        if judged or (len(rows.removes) and (len(rows.keys) or admitted.refuse_missing)):
            self.check(admitted)
        changes = hull.changes
        verdict = self._gate.judge(admitted, revision, hull, self.globe, self._written) if judged else NOTHING_HELD
        rows = admitted.rows
        try:
            put, removed, evicted = self._carry_out(rows)
        except DuplicateKeyError as error:
            part = "puts.keys" if len(rows.keys) else "removes"
            raise KeyRepeatedError(error.key, (part, error.rows[0]), (part, error.rows[1])) from None
        self.clock = admitted.clock
        if rows.held is not None:
            self._gate.follow(rows.held)
        return Applied(
            revision,
            put.new,
            removed,
            len(rows.removes) - removed + verdict.missing,
            hull.changes != changes,
            len(hull),
            moved=put.moved + put.unmoved,
            stale=put.stale + verdict.stale,
            late=admitted.late,
            skipped=put.skipped,
            clamped=admitted.clamped,
            evicted=evicted,
            clock=self.clock,
            held=verdict.held,
            released=verdict.released,
            dropped=verdict.dropped,
        )

    def rows(self, admitted: AdmittedPuts, _: Applied) -> KeyRows:
        """The keys of an applied batch, without those that are too old."""
        return admitted.rows

    def cause(self, admitted: AdmittedPuts) -> Cause:
        """What makes the revision of a batch: a client that changes positions, or what is held of them."""
        return "batch" if admitted.request is None else "quarantine"

    def recenter(self, center: Center | None) -> KeyRows:
        """Move the centre of a geographic hull, or raise MisfitError. Returns no rows. O(n log n)."""
        move_center(self.hull, center)
        return KeyRows(no_keys(self._kind), NO_POINTS, no_keys(self._kind))

    def expire(self, clock: int) -> Expiry | None:
        """Advance the clock, and remove the points that leave. If none do, the clock stays."""
        clock = clock if self.clock is None else max(clock, self.clock)
        until = too_old(self._settings, clock)
        leaving = self._expire(until, clock)
        if not leaving:
            return None
        self.clock = clock
        self._gate.expire(clock)
        return Expiry(until, leaving)

    def replay(self, records: Iterable[Record]) -> None:
        """Apply recorded changes, many at a time."""
        group: list[KeyRows] = []
        size = 0
        for record in records:
            rows = record.rows
            assert isinstance(rows, KeyRows | Expiry)
            alone = record.center is not None or size >= REPLAYED_TOGETHER
            if group and (alone or not self._may_follow(group[-1], rows)):
                self._load_after(merged(group))
                group, size = [], 0
            if record.center is not None or isinstance(rows, Expiry):
                self.build()
            if record.center is not None:
                move_center(self.hull, record.center)
            if isinstance(rows, Expiry):
                assert record.clock is not None  # nothing expires without a clock
                self._expire(rows.until, record.clock)
            else:
                group.append(rows)
                size += len(rows)
            self.clock = record.clock
            self._gate.expire(record.clock)
            if isinstance(rows, KeyRows) and rows.held is not None:
                self._gate.follow(rows.held)
        if group:
            self._load_after(merged(group))

    def _may_follow(self, before: KeyRows, rows: KeyRows | Expiry) -> bool:
        """Whether two changes have the effect of one that has the last position of each key."""
        window = self._settings.window
        if isinstance(rows, Expiry) or self._settings.by_event_time or len(self._deadlines):
            return False
        if window is not None and window.max_points:
            return False
        alike = (before.times is None) == (rows.times is None)
        return alike and all(each.condition is None and each.deadlines is None for each in (before, rows))

    def stored(self) -> Contents:
        """The points in the order of their keys. O(n log n)."""
        keys, points, times = self.hull.entities()
        deadlines = self._ends(keys)
        held = self.quarantine.stored() if self.quarantine else None
        accuracies = self.accuracies(keys)
        return Contents(points, keys, stored_times(times) if self.timed else None, deadlines, held, accuracies)

    def _ends(self, keys: Keys) -> Times | None:
        """The deadlines of keys that are there; None where none has one, though some that were evicted had."""
        found = self._deadlines.of(key_list(keys)) if len(self._deadlines) else None
        return found if found is not None and (found != FOREVER).any() else None

    def accuracies(self, keys: Keys) -> Accuracies | None:
        """The errors of the positions of keys that are there; None where all are 0."""
        found = self._accuracies.of(key_list(keys)) if len(self._accuracies) else None
        return found if found is not None and found.any() else None

    def in_plane(self) -> KeyedHull:
        """The keys as points of a plane: those of a geographic hull at their projections. O(n log n) the first time."""
        if isinstance(self.hull, KeyedHull):
            return self.hull
        if self.mirror is None:
            self.mirror = Mirror(self.hull)
        return self.mirror.plane

    def find(self, keys: Keys) -> Found:
        """The positions of keys of the hull's kind."""
        points = self.hull.positions(keys)
        times = stored_times(self.hull.times(keys)) if self.timed else None
        present = ~np.isnan(points[:, 0])
        accuracies = self.accuracies(keys)
        return Found(points, present, times, None if accuracies is None else np.where(present, accuracies, 0.0))

    # Changes

    def _load(self, stored: Parts) -> HeldRows | None:
        """Have what was stored. Returns what is in quarantine."""
        parts, held = stored.parts if self.globe is None else [in_one(stored.parts)], None
        for part in parts:
            held = part.held if held is None else held
            if part.keys is not None:
                self._load_part(part.keys, part)
        return held

    def _load_part(self, keys: Keys, stored: Contents) -> None:
        times = None if stored.times is None else library_times(stored.times)
        if self._loader is not None:
            self._loader.update(keys, stored.points, times)
        elif self.globe is not None:
            self.hull = GeoKeyedHull.from_entities(
                keys,
                stored.points,
                times,
                self._kind,
                ordered=self._settings.by_event_time,
                center=self.globe.center,
            )
        if stored.times is not None:
            self._note_times(stored.times)
        if stored.deadlines is not None:
            self._deadlines = given_deadlines(self._deadlines, key_list(keys), stored.deadlines.tolist())
        if stored.accuracies is not None:
            self._accuracies = given_accuracies(self._accuracies, key_list(keys), stored.accuracies.tolist())

    def build(self) -> None:
        """Build the hull of what was stored, and of the changes after it that have been replayed. O(n log n)."""
        if self._loader is not None:
            self.hull, self._loader = self._loader.hull(), None

    def packed(self, most: int) -> PackedHull | None:
        """The keys and their places, in place of `build`; None if they have anything else, or are more than `most`."""
        more = self.timed or self.clock is not None or self.quarantine is not None
        if self._loader is None or more or len(self._deadlines) or len(self._accuracies):
            return None
        return self._loader.packed(most)

    def hold(self, hull: KeyedHull) -> None:
        """Have the hull of what `packed` has returned, in place of `build`."""
        self.hull, self._loader = hull, None

    def _load_after(self, rows: KeyRows) -> None:
        """Have a change as if it had been stored, where it only puts and removes keys: the hull is built once."""
        loader = self._loader
        if loader is None or not self._is_plain(rows):
            self.build()
            self._carry_out(rows)
            return
        if len(rows.removes):
            loader.remove_many(rows.removes)
        times = None if rows.times is None else library_times(rows.times)
        if 0 < len(rows.keys) <= LOADED_TOGETHER:
            loader.update(rows.keys, rows.points, times)
        else:
            for first in range(0, len(rows.keys), LOADED_TOGETHER):
                some = slice(first, first + LOADED_TOGETHER)
                loader.update(rows.keys[some], rows.points[some], None if times is None else times[some])
        if rows.times is not None:
            self._note_times(rows.times)

    def _is_plain(self, rows: KeyRows) -> bool:
        """Whether a change does nothing but put and remove keys, here where none but these leave."""
        if self._settings.window is not None and self._settings.window.max_points:
            return False
        said = rows.condition, rows.deadlines, rows.accuracies, rows.held
        return not (len(self._deadlines) or len(self._accuracies) or any(each is not None for each in said))

    def _carry_out(self, rows: KeyRows) -> tuple[Put, int, int]:
        """Apply rows whose keys are all different. Returns the counts of the puts, keys removed, and keys evicted."""
        hull, times = self.hull, rows.times
        if self.mirror is not None:
            self.mirror.change(rows)
        removed = hull.remove_many(rows.removes, missing="ignore") if len(rows.removes) else 0
        written = None
        deadlines, accuracies = self._deadlines, self._accuracies
        has_deadlines = rows.deadlines is not None or (deadlines is not NO_DEADLINES and len(deadlines) > 0)
        has_accuracies = rows.accuracies is not None or (accuracies is not NO_ACCURACIES and len(accuracies) > 0)
        if has_deadlines or has_accuracies:
            written = self._written(rows)
        put = NOTHING_PUT
        if len(rows.keys):  # otherwise a hull by event time would ask for times
            put = update(hull, rows, rows.points)
        if times is not None:
            self._note_times(times)
        if written is not None and has_deadlines:
            self._set_deadlines(rows, written)
        if written is not None and has_accuracies:
            self._set_accuracies(rows, written)
        window = self._settings.window
        surplus = 0 if window is None or not window.max_points else len(hull) - window.max_points
        if surplus > 0 and self.mirror is not None:
            self.mirror.evict(surplus)
        return put, removed, hull.evict(surplus) if surplus > 0 else 0

    def _note_times(self, times: Times) -> None:
        self.timed = True
        known = times[times != NO_TIME]
        if known.size:
            earliest = int(known.min())
            self._earliest = earliest if self._earliest is None else min(earliest, self._earliest)

    def _written(self, rows: KeyRows) -> npt.NDArray[np.bool_]:
        """The rows of the puts that will be written: neither skipped nor stale."""
        written = np.ones(len(rows.keys), np.bool_)
        if rows.condition is not None:
            written &= self._has(rows.keys) == (rows.condition == "present")
        if self._settings.by_event_time and rows.times is not None:
            written &= ~(rows.times < self.hull.times(rows.keys))
        return written

    def _set_deadlines(self, rows: KeyRows, written: npt.NDArray[np.bool_]) -> None:
        keys = list(compress(key_list(rows.keys), written.tolist()))
        if rows.deadlines is None:
            self._deadlines.drop(keys)
        else:
            self._deadlines = given_deadlines(self._deadlines, keys, rows.deadlines[written].tolist())
        self._deadlines.drop(key_list(rows.removes))
        if len(self._deadlines) > 2 * len(self.hull) + MOST_SPARE:
            keys = self._deadlines.keys()
            there = self._has(of_kind(keys, rows.keys))
            self._deadlines.drop(compress(keys, (~there).tolist()))  # evicted, or too old before their deadline

    def _set_accuracies(self, rows: KeyRows, written: npt.NDArray[np.bool_]) -> None:
        keys = list(compress(key_list(rows.keys), written.tolist()))
        if rows.accuracies is None:
            self._accuracies.drop(keys)
        else:
            self._accuracies = given_accuracies(self._accuracies, keys, rows.accuracies[written].tolist())
        self._accuracies.drop(key_list(rows.removes))
        if len(self._accuracies) > 2 * len(self.hull) + MOST_SPARE:
            keys = self._accuracies.keys()
            there = self._has(of_kind(keys, rows.keys))
            self._accuracies.drop(compress(keys, (~there).tolist()))  # evicted, or too old

    def _expire(self, until: int | None, clock: int) -> int:
        """Remove the points that leave. Returns their number."""
        hull, mirror = self.hull, self.mirror
        leaving = 0
        if until is not None and until < -GREATEST_TIME:
            until = None
        if mirror is not None:
            mirror.expire(until)
        if until is not None:
            leaving = hull.expire(until)
            oldest = hull.oldest()
            self._earliest = None if oldest is None else int(oldest)
        ended = self.ended = self._deadlines.pop_until(clock)
        for first in range(0, len(ended), REMOVED_TOGETHER):
            leaving += hull.remove_many(ended[first : first + REMOVED_TOGETHER], missing="ignore")
            if mirror is not None:
                mirror.remove(ended[first : first + REMOVED_TOGETHER])
        return leaving

    # Rules

    def _admit_deadlines(self, batch: KeyedBatch, rows: KeyRows, admission: Admission, arrived: int) -> None:
        """Set the deadlines of the rows, and the clock of a hull that has one because of them."""
        if self._settings.window is None:
            admission.clock = server_clock(self.clock, arrived)
        if batch.ttl is not None:
            start = arrived if self.follows_server else admission.clock
            deadline = (start or 0) + batch.ttl
            if deadline > GREATEST_TIME:
                problem = f"leads to a time after {shown(GREATEST_TIME)}, the last one that a deadline can be"
                raise InvalidBatchError("puts.ttl", f"{batch.ttl} microseconds", problem)
            rows.deadlines = np.full(len(batch.keys), deadline, np.int64)
        if admission.clock is not None and rows.deadlines is not None:
            there = rows.deadlines > admission.clock
            if not there.all():
                admission.young = there if admission.young is None else there & admission.young

    def _refuse_growth(self, admitted: AdmittedPuts) -> None:
        """Raise LimitExceededError if there would be too many keys in the hull and, held out, beside it. O(m)."""
        rows, window, clock = admitted.rows, self._settings.window, admitted.clock
        if rows.condition == "present":
            return
        absent, beside = ~self._there(rows.keys, clock), self._only_held(clock)
        new = int(np.count_nonzero(absent))
        if beside:
            new -= sum(key in beside for key in compress(key_list(rows.keys), absent.tolist()))
        inside = self._number(clock) + new - int(np.count_nonzero(self._there(rows.removes, clock)))
        if window is not None and window.max_points:
            inside = min(inside, window.max_points)
        if new and inside + len(beside.difference(key_list(rows.removes))) > self._most_points:
            raise LimitExceededError("max_points", self._most_points)

    def _only_held(self, clock: int | None) -> set[Key]:
        """The keys in quarantine that are not in the hull, once those have left that leave at `clock`. O(m)."""
        if not self.quarantine:
            return set()
        keys = self.quarantine.staying(too_old(self._settings, clock), clock)
        there = self._there(of_kind(keys, no_keys(self._kind)), clock)
        return set(compress(keys, (~there).tolist()))

    def _has(self, keys: Keys) -> npt.NDArray[np.bool_]:
        """Which keys are there."""
        return ~np.isnan(self.hull.positions(keys)[:, 0])

    def _there(self, keys: Keys, clock: int | None) -> npt.NDArray[np.bool_]:
        """Which keys are there once those have left that leave at `clock`."""
        there = self._has(keys)
        if clock is None:
            return there
        until = too_old(self._settings, clock)
        if until is not None:
            there &= ~(self.hull.times(keys) <= until)
        first = self._deadlines.first
        if first is not None and first <= clock:
            there &= self._deadlines.of(key_list(keys)) > clock
        return there

    def _number(self, clock: int | None) -> int:
        """The number of keys once those have left that leave at `clock`. O(n log n) if any do."""
        if clock is None:
            return len(self.hull)
        return int(np.count_nonzero(self._there(self.hull.entities()[0], clock)))
