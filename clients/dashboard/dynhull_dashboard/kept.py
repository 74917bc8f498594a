"""What the server has kept of the past of a hull."""

from contextlib import suppress
from datetime import datetime
from math import ceil
from typing import Any

from dynhull_client import AsyncHullClient, DynhullError, Erasure, History, HullUnsuitableError

TIMEOUT_SECONDS = 5.0
MOST_ERASURES = 100


class Kept:
    """How far the past of a hull goes back, asked now and then.

    Attributes:
        history: what is there; None before the first answer, and where there is none.
        trouble: why there is none; None where there is.
    """

    def __init__(self, client: AsyncHullClient, name: str) -> None:
        self.history: History | None = None
        self.trouble: DynhullError | None = None
        self._client = client
        self._name = name
        self._times: dict[
            int, datetime | None
        ] = {}  # when the revisions were committed at which erasures begin and end

    @property
    def first(self) -> datetime | None:
        """The oldest moment that can be shown; None where none is kept."""
        return None if self.history is None or self.history.history is None else self.history.first_time

    def erased(self, revision: int) -> Erasure | None:
        """The last erasure after which this revision may lack keys; None if there was none."""
        erasures = () if self.history is None else self.history.erasures
        return next(
            (each for each in reversed(erasures) if each.first_revision <= revision <= each.last_revision), None
        )

    def spans(self) -> list[list[float]]:
        """From when to when keys were erased, in milliseconds since 1970."""
        erasures = () if self.history is None else self.history.erasures
        ends = ((self._times.get(each.first_revision), self._times.get(each.last_revision)) for each in erasures)
        return [[1000 * begin.timestamp(), 1000 * end.timestamp()] for begin, end in ends if begin and end]

    def words(self, address: str) -> str:
        """What to say to who wants to go back further than the page does; empty where nothing is to be done."""
        match self.trouble:
            case HullUnsuitableError() as error:
                return f"{error}."
            case None if self.history is not None and self.history.history is None:
                return f"{self._name} keeps no past. Keep it: dynhull history set {self._name} 30d --address {address}"
            case _:
                return ""

    def message(self, address: str) -> dict[str, Any]:
        """All of it for the page."""
        first = None if self.first is None else ceil(1000 * self.first.timestamp())  # not before it
        return {"hull": self._name, "first": first, "erased": self.spans(), "words": self.words(address)}

    async def ask(self) -> None:
        """Ask the server. Raises DynhullError where there is no past."""
        try:
            history = await self._client.history(self._name, timeout=TIMEOUT_SECONDS)
            await self._ask_times(history)
        except DynhullError as error:
            self.history, self.trouble = None, error
            raise
        self.history, self.trouble = history, None

    async def _ask_times(self, history: History) -> None:
        """Ask when the revisions were committed between which keys were erased: they do not change."""
        erasures = history.erasures[-MOST_ERASURES:]
        ends = {end for each in erasures for end in (each.first_revision, each.last_revision)}
        self._times = {end: time for end, time in self._times.items() if end in ends}
        for end in ends - self._times.keys():
            readable = max(end, history.first_revision)
            with suppress(DynhullError):  # a segment is away
                self._times[end] = (await self._client.at(self._name, readable, timeout=TIMEOUT_SECONDS)).time
