"""Dead letters: events that a receiver refused, kept as files, and receivers that are gone."""

import hashlib
import json
import os
import re
import time
from dataclasses import dataclass
from pathlib import Path

from .letters import Letter, read_letter
from .sources import Source

UNSAFE = re.compile(r"[^A-Za-z0-9._-]")
DIGITS_OF_A_RECEIVER = 16


@dataclass(frozen=True, slots=True)
class DeadLetter:
    """An event that was refused.

    Attributes:
        letter: the event.
        place: where it was to go.
        reason: why it was refused the last time.
        attempts: how often it was tried.
        time: when it was given up, in seconds since 1970.
        paths: its file; several where earlier versions kept it more than once.
    """

    letter: Letter
    place: str
    reason: str
    attempts: int
    time: float
    paths: tuple[Path, ...]

    def remove(self) -> None:
        """Keep it no longer."""
        for path in self.paths:
            path.unlink(missing_ok=True)


class StateFolder:
    """The folder in which a relay keeps what must survive it and is not on the server.

    Each dead letter is a file of its own, so that a relay may add some while others are sent again. Its name is that of
    the event and the receiver: an event that arrives and is refused again, because the relay was killed before it
    acknowledged it, is the same dead letter.

    Args:
        path: the folder; it is created when there is something to keep.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._letters = path / "dead-letters"
        self._gone = path / "gone.json"

    def bury(self, letter: Letter, place: str, reason: str, attempts: int) -> None:
        """Keep an event that was refused. It is on the disk when this returns."""
        now = time.time()
        members = {"place": place, "reason": reason, "attempts": attempts, "time": now, "event": letter.text}
        receiver = hashlib.sha256(place.encode()).hexdigest()[:DIGITS_OF_A_RECEIVER]
        _store(self._letters / f"{UNSAFE.sub('_', letter.id)}-{receiver}.json", members)

    def dead_letters(self) -> list[DeadLetter]:
        """All dead letters, the oldest first, each once; ValueError names a file that is none."""
        found: dict[tuple[str, str], DeadLetter] = {}
        for path in sorted(self._letters.glob("*.json")):
            try:
                kept = json.loads(path.read_text("utf-8"))
                event = read_letter(kept["event"])
                identity = event.id, kept["place"]
                others = found[identity].paths if identity in found else ()
                found[identity] = DeadLetter(
                    event, kept["place"], kept["reason"], kept["attempts"], kept["time"], (*others, path)
                )
            except (KeyError, TypeError, ValueError):
                raise ValueError(f"{path} is not a dead letter") from None
        return sorted(found.values(), key=lambda each: (each.time, each.letter.sequence))

    def gone(self) -> dict[str, str]:
        """The sources whose receiver wants nothing any more, each with the receiver, and what it answered."""
        if not self._gone.exists():
            return {}
        try:
            found = json.loads(self._gone.read_text("utf-8"))
            return {str(source): str(answer) for source, answer in found.items()}
        except (AttributeError, ValueError):
            raise ValueError(f"{self._gone} does not list the receivers that are gone: --enable removes it") from None

    def disable(self, source: Source, to: str, answer: str) -> None:
        """Remember that the receiver of a source is gone."""
        _store(self._gone, self.gone() | {gone_key(source, to): answer})

    def enable(self) -> None:
        """Forget which receivers are gone."""
        self._gone.unlink(missing_ok=True)


def gone_key(source: Source, to: str) -> str:
    """What `StateFolder.gone` calls a source and its receiver."""
    return f"{source} to {to}"


def _store(path: Path, members: dict[str, object] | dict[str, str]) -> None:
    """Write a file as a whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".unfinished")
    try:
        with unfinished.open("w", encoding="utf-8") as file:
            json.dump(members, file)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    unfinished.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
