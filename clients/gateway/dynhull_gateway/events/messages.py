"""Events as text for EventSource."""

import json
import re
from typing import Any

from pydantic import AfterValidator
from pydantic_core import to_json

from dynhull_client import DynhullError
from dynhull_surface.reasons import Repeat, repeat_of

from ..refusals import of_refusal

RETRY_MILLISECONDS = 1000
OVER, ANY = "over", "any"  # in an id, after the uid; and for a uid that is not known
FIRST = f"retry: {RETRY_MILLISECONDS}\n\n".encode()
COMMENT = b": \n\n"


def message(kind: str, ident: str, data: Any) -> bytes:
    """An event with a name, an id to resume after, and data as JSON; null where a number is not finite."""
    lines = f"event: {kind}\n" + (f"id: {ident}\n" if ident else "") + "data: "
    return lines.encode() + to_json(data, inf_nan_mode="null") + b"\n\n"


def problem(error: DynhullError, ident: str = "") -> bytes:
    """The event that ends a stream: the problem details of an error."""
    return message("problem", ident, json.loads(bytes(of_refusal(error).body)))


def last_problem(error: DynhullError) -> bytes:
    """The same, with an id after which a browser is not to connect again unless the error may pass."""
    return problem(error, "" if repeat_of(error.reason, error.code.name) is not Repeat.NO else over())


def over(uid: str = "") -> str:
    """The id of the last event of a stream: who connects again with it is answered with 204, which ends it for good."""
    return f"{uid or ANY}:{OVER}"


def _id_of(form: str, words: str) -> AfterValidator:
    """Refuses a Last-Event-ID of no event of a stream: to begin elsewhere in silence would be to lose events."""
    known = re.compile(form, re.ASCII)

    def checked(ident: str | None) -> str | None:
        if ident and not (known.fullmatch(ident) and all(int(each) < 2**64 for each in NUMBER.findall(ident))):
            raise ValueError(f"must be the id of an event of such a stream, {words}")
        return ident or None  # an EventSource without an id has an empty one

    return AfterValidator(checked)


NUMBER = re.compile(r"(?<=[:~])\d+")
PLACE = r"[!-~]+:\d{1,20}"
POSITION = r"(?:[0-9a-f]{2})+"
ENDED = rf"[!-~]+:{OVER}"
REVISION_ID = _id_of(PLACE, "UID:REVISION")
SEQUENCE_ID = _id_of(PLACE, "UID:SEQUENCE")
PART_ID = _id_of(rf"{PLACE}(?:~\d{{1,20}})?", "UID:SEQUENCE")
ENDING_ID = _id_of(f"{PLACE}|{ENDED}", "UID:REVISION")
MANY_ID = _id_of(POSITION, "a position")
MANY_ENDING_ID = _id_of(f"{POSITION}|{ENDED}", "a position")


def is_over(ident: str | None) -> bool:
    """Whether a Last-Event-ID is that of the last event of a stream."""
    uid, _, end = (ident or "").rpartition(":")
    return bool(uid) and end == OVER


# A browser passes on only events with data.
UNAVAILABLE = message("unavailable", "", {"detail": "the gateway has lost its server"})
AVAILABLE = message("available", "", {})


def place(ident: str) -> bytes:
    """An id alone, which a browser notes without an event."""
    return f"id: {ident}\n\n".encode()


def parted(ident: str | None) -> tuple[str | None, int]:
    """A Last-Event-ID "UID:AFTER~EXACT" as "UID:AFTER" and the number behind, which is 0 for others."""
    place, _, exact = (ident or "").partition("~")
    return place or None, int(exact or 0)


def resumed(ident: str | None) -> tuple[str, int] | None:
    """The uid and the number in a Last-Event-ID; None if there is none."""
    uid, _, number = (ident or "").rpartition(":")
    return (uid, int(number)) if uid else None


def position_of(ident: str | None) -> bytes | None:
    """The position of many hulls in a Last-Event-ID; None if there is none."""
    return bytes.fromhex(ident) if ident else None
