"""Access control: bearer tokens, each with the names it may read and write."""

import hashlib
import logging
import os
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..state.errors import RefusedError

# Seconds between checks of the token file for changes.
LOOK_SECONDS = 0.25
# Hexadecimal digits that stand for a token without a name.
SHORT_HASH = 12

log = logging.getLogger(__name__)


class UnauthenticatedError(RefusedError):
    """The caller has no token, or an unknown one."""

    def __init__(self) -> None:
        super().__init__('a valid token is required: metadata "authorization" with "Bearer " and the token')


class TokensChangedError(Exception):
    """The tokens have changed: a caller for others has to have each of them ask anew."""

    def __init__(self) -> None:
        super().__init__("the tokens have changed")


class PermissionDeniedError(RefusedError):
    """The caller's token does not allow the request. This does not reveal whether the hull exists.

    Attributes:
        scope: "read", "write" or "read the past of".
        name: the name requested.
    """

    def __init__(self, scope: str, name: str) -> None:
        super().__init__(f"this token may not {scope} {name!r}")
        self.scope = scope
        self.name = name


@dataclass(frozen=True, slots=True)
class Access:
    """The prefixes of the names that a caller may read, that it may write, and whose past it may read, too."""

    read: tuple[str, ...]
    write: tuple[str, ...]
    past: tuple[str, ...] = ()

    def may_read(self, name: str) -> bool:
        """Whether what has this name may be read."""
        return name.startswith(self.read)

    def require_read(self, name: str) -> None:
        """Raise PermissionDeniedError if the hull may not be read."""
        if not self.may_read(name):
            raise PermissionDeniedError("read", name)

    def require_past(self, name: str) -> None:
        """Raise PermissionDeniedError if the past of the hull may not be read."""
        self.require_read(name)
        if not self.may_read_past(name):
            raise PermissionDeniedError("read the past of", name)

    def may_read_past(self, name: str) -> bool:
        """Whether the past of the hull may be read."""
        return self.may_read(name) and name.startswith(self.past)

    def may_write(self, name: str) -> bool:
        """Whether the hull may be written."""
        return name.startswith(self.write)

    def require_write(self, name: str) -> None:
        """Raise PermissionDeniedError if the hull may not be written."""
        if not self.may_write(name):
            raise PermissionDeniedError("write", name)

    def readable(self, prefix: str) -> list[str]:
        """The prefixes of the readable names that begin with `prefix`: sorted, none a prefix of another."""
        within = sorted({max(prefix, each, key=len) for each in self.read if _overlap(prefix, each)})
        return [each for i, each in enumerate(within) if not each.startswith(tuple(within[:i]))]


EVERYTHING = Access(("",), ("",), ("",))


@dataclass(frozen=True, slots=True)
class Caller:
    """The identity of a caller.

    Attributes:
        owner: the name whose limits apply; if empty, the limits apply to the address of the call.
        access: its permissions.
        key: the hash of its token; empty if the server uses no tokens.
        for_others: whether it passes what it gets on to others, each of which has to be allowed that by itself.
    """

    owner: str
    access: Access
    key: str = ""
    for_others: bool = False


ANONYMOUS = Caller("", EVERYTHING)
UNAUTHENTICATED_CALLER = Caller("", Access((), ()))


class Rights:
    """The permissions of one call. It records what was granted, so that a changed token can end the call."""

    __slots__ = ("_access", "_granted")

    def __init__(self, access: Access) -> None:
        self._access = access
        self._granted: list[tuple[Callable[[Access, str], None], str]] = []

    def require_read(self, name: str) -> None:
        """Raise PermissionDeniedError if the hull may not be read."""
        self._access.require_read(name)
        self._granted.append((Access.require_read, name))

    def require_write(self, name: str) -> None:
        """Raise PermissionDeniedError if the hull may not be written."""
        self._access.require_write(name)
        self._granted.append((Access.require_write, name))

    def require_past(self, name: str) -> None:
        """Raise PermissionDeniedError if the past of the hull may not be read."""
        self._access.require_past(name)
        self._granted.append((Access.require_past, name))

    def may_read(self, name: str) -> bool:
        """Whether the name may be told."""
        return self._access.may_read(name)

    def may_read_past(self, name: str) -> bool:
        """Whether the past of the hull may be read, at this moment."""
        return self._access.may_read_past(name)

    def may_write(self, name: str) -> bool:
        """Whether the hull may be written, at this moment."""
        return self._access.may_write(name)

    def readable(self, prefix: str) -> list[str]:
        """The prefixes of the readable names that begin with `prefix`."""
        return self._access.readable(prefix)

    def forget(self) -> None:
        """Forget what was granted, because nothing that needed it is in progress."""
        self._granted.clear()

    def change(self, access: Access) -> None:
        """Replace the permissions, or raise PermissionDeniedError if they do not allow what was granted."""
        self._access = access
        for require, name in self._granted:
            require(access, name)


def _overlap(a: str, b: str) -> bool:
    return a.startswith(b) or b.startswith(a)


class TokenEntry(BaseModel):
    """One [[token]] entry of the file."""

    model_config = ConfigDict(extra="forbid")

    name: str = ""
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    read: list[str] = []
    write: list[str] = []
    past: list[str] = []


class TokenTable(BaseModel):
    """The content of the file."""

    model_config = ConfigDict(extra="forbid")

    token: list[TokenEntry] = []


class TokenFile:
    """Tokens from a TOML file of hashes, which is read again when it changes.

    [[token]]
    name = "trucks"      # for people and for limits; by default, the first digits of the hash
    sha256 = "9f86d0..." # the hash of the token, in hexadecimal digits
    read = ["fleet/"]    # prefixes of names; "" matches every name
    write = ["fleet/truck-"]
    past = ["fleet/"]    # whose past may be read, too; by default of none

    If the file becomes unreadable or invalid, the log reports it, and the tokens do not change.

    Attributes:
        changed: called after changed tokens have been read.

    Raises:
        ValueError: the file is invalid. OSError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._version = self._current_version()
        self._callers = self._load()
        self._trouble = ""
        self.changed: Callable[[], None] = lambda: None

    def authenticate(self, metadata: Iterable[tuple[str, Any]]) -> Caller:
        """The caller with this metadata, or raise UnauthenticatedError."""
        self.look()
        return self.bearer(str(dict(metadata).get("authorization", "")))

    def bearer(self, authorization: str) -> Caller:
        """The caller with this token, as last read from the file, or raise UnauthenticatedError."""
        kind, _, token = authorization.partition(" ")
        if kind.lower() != "bearer":
            raise UnauthenticatedError
        return self.known(hashlib.sha256(token.strip().encode()).hexdigest())

    def known(self, key: str) -> Caller:
        """The caller whose token has this hash, or raise UnauthenticatedError."""
        caller = self._callers.get(key)
        if caller is None:
            raise UnauthenticatedError
        return caller

    async def run(self) -> None:
        """Check the file, every LOOK_SECONDS, so that a change ends running calls without waiting for the next call."""
        self.look()

    def look(self) -> None:
        """Read the file if it has changed."""
        try:
            version = self._current_version()
            if version == self._version:
                return
            callers = self._load()
        except ValueError as error:
            self._version = version  # it stays invalid until it changes
            self._complain(error)
        except OSError as error:  # perhaps it can be read later
            self._complain(error)
        else:
            self._version, self._callers, self._trouble = version, callers, ""
            log.info("tokens read again", extra={"tokens": len(callers)})
            self.changed()

    def _complain(self, error: Exception) -> None:
        if str(error) != self._trouble:  # log it once: each call checks the file
            self._trouble = str(error)
            log.error("the tokens do not change: %s", error)  # the message is complete without a traceback

    def _current_version(self) -> tuple[int, int, int]:
        stat = os.stat(self._path)  # noqa: PTH116  # faster, and each call runs it
        return stat.st_mtime_ns, stat.st_size, stat.st_ino

    def _load(self) -> dict[str, Caller]:
        try:
            table = TokenTable.model_validate(tomllib.loads(self._path.read_text("utf-8")))
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, first["loc"]))
            raise ValueError(f"{self._path}: {where}: {first['msg']}") from None
        except ValueError as error:
            raise ValueError(f"{self._path}: {error}") from None
        if not table.token:
            log.warning("the file of tokens has none: every call is refused", extra={"file": str(self._path)})
        return {
            each.sha256: Caller(
                each.name or each.sha256[:SHORT_HASH],
                Access(tuple(each.read), tuple(each.write), tuple(each.past)),
                each.sha256,
            )
            for each in table.token
        }
