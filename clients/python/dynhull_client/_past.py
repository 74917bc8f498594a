"""Hulls as they were: what both clients have in common."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dynhull_proto.v1 import hull_service_pb2 as pb

from . import _messages as messages
from ._arguments import whole
from ._calls import Call
from ._methods import described, documented
from ._times import as_microsecond

if TYPE_CHECKING:
    from collections.abc import Callable

    from ._messages import HullInfo

Result = TypeVar("Result")
When = int | str | datetime | np.datetime64


def at(name: str, when: When | None = None, *, time: int | None = None, timeout: float | None = None) -> Call[HullInfo]:
    """A hull as it was: an object with the reading methods, which take no name, and answer as of one revision.

    It is a moment of the server's clock: that of the last revision committed at or before it. All answers are exactly
    those of the hull while that revision was its newest.

    Raises:
        RevisionForgottenError: the server does not keep that moment any more, or it has not come.

    Args:
        name: the hull.
        when: a revision; or a time, a datetime with a time zone or such a text of ISO 8601.
        time: a time in microseconds since 1970, in place of `when`.
        timeout: seconds, instead of the client's.
    """
    if (when is None) == (time is None):
        raise TypeError("at takes either when, a revision or a time, or time, microseconds since 1970")
    request = pb.GetHullRequest(name=name, view=pb.HULL_VIEW_BASIC)
    if time is not None:
        request.at_time.FromMicroseconds(as_microsecond(time, "time"))
    else:
        encode_moment(request, "at", when, "when")
    return Call("GetHull", request, lambda response: messages.decode_info(response.hull), timeout)


def encode_moment(request: Any, field: str, when: When | None, name: str) -> None:
    """Write a revision, or a time, into the fields of a request that begin so; nothing for None.

    `name` is what error messages call it.
    """
    if when is None:
        return
    if isinstance(when, int | np.integer) and not isinstance(when, bool | np.bool_):
        setattr(request, f"{field}_revision", whole(name, when, bits=64))
    else:
        getattr(request, f"{field}_time").FromMicroseconds(as_microsecond(when, name))


class AsOf:
    """What `Past` and `AsyncPast` have in common: one revision of a hull.

    Attributes:
        name: the name of the hull.
        revision: the revision.
        time: when it was committed; of revision 0, when the hull was created; None where that is not known.
        erased: whether the hull may lack keys that it had then, because `erase_history` has erased them.
        uid: the uid of the hull.
    """

    def __init__(self, connection: Any, info: HullInfo) -> None:
        self._connection = connection
        self.name = info.name
        self.revision = info.revision
        self.time = info.changed
        self.erased = info.erased
        self.uid = info.uid

    def __repr__(self) -> str:
        return f"<{self.name} at revision {self.revision}{'' if self.time is None else f', {self.time.isoformat()}'}>"

    def _call(self, describe: Callable[..., Call[Result]], arguments: Any, options: Any) -> Call[Result]:
        """The call that asks about this revision."""
        return self._of_then(described(describe, self.name, *arguments, **options))

    def _of_then(self, call: Call[Result]) -> Call[Result]:
        """A call, asked about this revision."""
        request: Any = call.request
        request.at_revision = self.revision
        request.at_uid = self.uid
        return call


def without_name(method: Any, describe: Callable[..., Any], returns: str) -> None:
    """Document a method as the function that describes its call, whose first argument is the hull."""
    documented(method, describe, returns, without=("name", "min_revision", "keys_of", "keys_min_revision"))
