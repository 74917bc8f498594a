"""Which batches make one round, and what each of them asks of which shard."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from dynhull_server.state.batch import Batch, KeyedBatch, Write
from dynhull_server.state.contents import gate, replayed
from dynhull_server.state.errors import HullUnsuitableError, LimitExceededError, MisfitError, RefusedError
from dynhull_server.state.producers import Producers
from dynhull_server.state.records import HullSettings, Kept
from dynhull_server.state.taking import TRIP_ROWS

from .messages import Effect, Step
from .parts import Admitted, Part, divided, first_refusal, most_growth, refusable, refuse_repeated
from .requests import RootWrite


@dataclass(slots=True)
class Plan:
    """A batch as a step of shards.

    Attributes:
        request: the request of the caller.
        number: the number of the step.
        admitted: the batch, as one hull admits it.
        clock: the clock of the hull after it, None for a hull without a clock.
        parts: the rows of each shard that has any.
        shards: the shards that it concerns: those with rows, and all where points may leave.
        undoable: whether a shard may have to undo it.
    """

    request: RootWrite
    number: int
    admitted: Admitted
    clock: int | None
    parts: Mapping[int, Part]
    shards: Collection[int]
    undoable: bool

    def step(self, shard: int) -> Step:
        """What it asks of a shard."""
        part = self.parts.get(shard)
        return Step(self.number, None if part is None else part.admitted, self.clock, self.undoable)

    def reason_to_refuse(self, effects: Mapping[int, Effect], points: int, most_points: int) -> RefusedError | None:
        """Why the batch is refused, if it is: by a shard, or by the limit on points, of which there were `points`."""
        refusals = [(self.parts[shard], effect.error) for shard, effect in effects.items() if effect.error is not None]
        if refusals:
            return first_refusal(self.admitted, refusals)
        after, grows = points - sum(effect.expired for effect in effects.values()), True
        if isinstance(self.admitted, gate.AdmittedPuts):
            applied = [effect.applied for effect in effects.values() if effect.applied is not None]
            new = sum(each.inserted for each in applied)
            after += new - sum(each.deleted for each in applied)
            grows = new > 0 and self.admitted.rows.condition != "present"
        else:
            after += most_growth(self.admitted)
        return LimitExceededError("max_points", most_points) if grows and after > most_points else None


class Planner:
    """Admits batches as one hull does.

    The first batch of a round is admitted to the hull as it is. Another one joins if it is admitted whatever becomes
    of those before it; otherwise it waits for the next round, which then begins with it.

    Args:
        settings: the settings of the hull.
        most_points: the limit on its points.
        producers: those that number their batches.
        shards: the number of shards.

    Attributes:
        shards: the number of shards.
    """

    def __init__(self, settings: HullSettings, most_points: int, producers: Producers, shards: int) -> None:
        self._gate = replayed(Kept(), settings)  # has no points
        self._most_points = most_points
        self._producers = producers
        self.shards = shards
        # As they will be after the batches so far, if all are applied; at most this number of points.
        self._number = self._points = self._rows = 0
        self._clock: int | None = None
        self._sequences: dict[str, int] = {}
        self._doubtful = False  # whether one of them may be refused

    def begin(self, request: RootWrite, number: int, points: int, clock: int | None) -> Plan | None:
        """The plan of the first batch of a round; None where it has already been applied; or raise what refuses it."""
        self._number, self._points, self._clock = number, points, clock
        self._rows, self._sequences, self._doubtful = 0, {}, False
        write = request.batch.write
        if write.producer and not self._producers.is_new(
            write.producer, write.sequence, write.owner, request.now, may_skip=write.may_skip, after=write.after
        ):
            return None
        return self._take(request, *self._admitted(write))

    def join(self, request: RootWrite) -> Plan | None:
        """The plan of a further batch of the round; None if it has to wait for the next one."""
        write = request.batch.write
        if write.producer:
            last = self._sequences.get(write.producer) or self._producers.last(write.producer)
            if not last or write.sequence != last + 1 or write.after not in (None, last):
                return None
        try:
            admitted, clock = self._admitted(write)
        except Exception:  # the next round decides whether it is refused
            return None
        if self._rows + write.rows > TRIP_ROWS or self._points + most_growth(admitted) > self._most_points:
            return None
        if self._doubtful and clock is not None:  # undoing a step where there is a clock takes long
            return None
        return self._take(request, admitted, clock)

    def _take(self, request: RootWrite, admitted: Admitted, clock: int | None) -> Plan:
        parts = divided(admitted, self.shards)
        shards: Collection[int] = range(self.shards) if clock != self._clock else parts
        suspect = self._points + most_growth(admitted) > self._most_points
        undoable = self._doubtful or suspect or (refusable(admitted) and len(shards) > 1)
        self._number += 1
        self._points += most_growth(admitted)
        self._clock = clock
        write = request.batch.write
        self._rows += write.rows
        if write.producer:
            self._sequences[write.producer] = write.sequence
        self._doubtful = self._doubtful or suspect or refusable(admitted)
        return Plan(request, self._number, admitted, clock, parts, shards, undoable)

    def _admitted(self, write: Write) -> tuple[Admitted, int | None]:
        """The batch, and the clock that it leads to; or raise what refuses it."""
        self._gate.clock = self._clock
        batch = write.batch
        try:
            if isinstance(batch, KeyedBatch) and batch.of_quarantine:
                raise MisfitError(batch.field, "has shards, so it has no quarantine")
            admitted: Admitted = self._gate.admit(batch, write.arrived)
        except MisfitError as misfit:
            raise HullUnsuitableError(write.name, str(misfit), field=f"batch.{misfit.field}") from None
        if isinstance(admitted, Batch):
            if self._points + admitted.growth > self._most_points:
                raise LimitExceededError("max_points", self._most_points)
            return admitted, None
        if isinstance(admitted, gate.AdmittedPuts):
            refuse_repeated(admitted.rows)
        return admitted, admitted.clock
