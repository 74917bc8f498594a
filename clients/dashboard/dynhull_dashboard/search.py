"""The keys that viewers look for in a hull."""

import asyncio
import math
import time
from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np

from dynhull_client import AsyncHullClient, HullCopy

from .degrees import shown_place

FORGET_SECONDS = 2.0
MOST_KEY_BYTES = 255
LARGEST_KEY = 2**64 - 1


class State(Enum):
    """What the server answers about a key."""

    PENDING = auto()
    MISSING = auto()
    LEFT = auto()  # missing now, but seen before
    INSIDE = auto()
    BOUNDARY = auto()
    VERTEX = auto()


@dataclass(frozen=True, slots=True)
class Sighting:
    """The last answer about a key.

    Attributes:
        state: where the key is; BOUNDARY excludes vertices.
        x: its coordinate; of a key that has left, the last one; NaN for a key that was never seen.
        y: likewise.
        revision: the revision of the hull with that position.
        accuracy: how far the position may be from where the key really is, in metres on the globe; 0 for not at all.
    """

    state: State
    x: float = math.nan
    y: float = math.nan
    revision: int = 0
    accuracy: float = 0.0

    @property
    def seen(self) -> bool:
        """Whether there is a position."""
        return self.state not in (State.PENDING, State.MISSING)

    @property
    def present(self) -> bool:
        """Whether the hull holds the key."""
        return self.seen and self.state is not State.LEFT


PENDING, MISSING = Sighting(State.PENDING), Sighting(State.MISSING)


class KeySearch:
    """Asks a hull where keys are: all viewers' keys in one request, and nothing while nobody looks for a key.

    Attributes:
        asked: set when a new key is looked for.
    """

    def __init__(self, client: AsyncHullClient, name: str) -> None:
        self.asked = asyncio.Event()
        self._client = client
        self._name = name
        self._wanted: dict[str, float] = {}
        self._seen: dict[str, Sighting] = {}

    def find(self, key: str) -> Sighting:
        """The last answer about the key. The key is forgotten unless it is asked for again within `FORGET_SECONDS`."""
        if key not in self._wanted:
            self.asked.set()
        self._wanted[key] = time.monotonic()
        return self._seen.get(key, PENDING)

    def forget(self) -> None:
        """Forget all answers: the hull was deleted."""
        self._seen = {}

    async def ask(self, copy: HullCopy) -> None:
        """Ask for all keys that are looked for. `copy` is the hull as watched with its keys.

        Raises:
            DynhullError: the server did not answer.
        """
        oldest = time.monotonic() - FORGET_SECONDS
        self._wanted = {key: at for key, at in self._wanted.items() if at > oldest}
        self._seen = {key: sighting for key, sighting in self._seen.items() if key in self._wanted}
        if not self._wanted or copy.vertex_keys is None:
            return
        integers = bool(copy.vertex_keys) and isinstance(copy.vertex_keys[0], int)
        keys = {text: key for text in self._wanted if (key := _as_key(text, integers)) is not None}
        found = await self._positions(list(dict.fromkeys(keys.values())), copy) if copy.vertex_keys and keys else {}
        for text in self._wanted:
            sighting = found.get(keys[text]) if text in keys else None
            self._seen[text] = sighting or self._lost(text)

    async def _positions(self, keys: list[str | int], copy: HullCopy) -> dict[str | int, Sighting]:
        """The keys that the hull holds."""
        answer = await self._client.positions(self._name, keys)
        located = await self._client.locate(self._name, keys=keys, min_revision=answer.revision)
        corners = set(copy.vertex_keys or ())
        found = {}
        accuracies = np.zeros(len(keys)) if answer.accuracies is None else answer.accuracies
        columns = answer.positions, answer.present, located.sides, accuracies.tolist()
        for key, position, present, side, accuracy in zip(keys, *columns, strict=True):
            if not present or side < 0:
                continue
            is_corner = key in corners or bool((copy.vertices == position).all(axis=1).any())
            state = State.INSIDE if side else State.VERTEX if is_corner else State.BOUNDARY
            x, y = shown_place(float(position[0]), float(position[1]), copy.center)
            found[key] = Sighting(state, x, y, answer.revision, accuracy)
        return found

    def _lost(self, text: str) -> Sighting:
        before = self._seen.get(text, MISSING)
        return replace(before, state=State.LEFT) if before.seen else MISSING


def _as_key(text: str, integers: bool) -> str | int | None:
    """The key as the hull has it; None for text that cannot be one of its keys."""
    try:
        if not 0 < len(text.encode()) <= MOST_KEY_BYTES:
            return None
    except UnicodeEncodeError:  # half of a surrogate pair, which JavaScript's text may hold
        return None
    if not integers:
        return text
    number = int(text) if text.strip().isdecimal() else LARGEST_KEY + 1
    return number if number <= LARGEST_KEY else None
