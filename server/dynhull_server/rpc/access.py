"""Who may do what: bearer tokens, each with the names it may read and write."""

import hashlib
import logging
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..state.errors import RefusedError

log = logging.getLogger(__name__)


class UnauthenticatedError(RefusedError):
    """The caller has no token, or one that is not known."""

    def __init__(self) -> None:
        super().__init__('a valid token is required: metadata "authorization" with "Bearer " and the token')


class PermissionDeniedError(RefusedError):
    """The caller's token does not allow it. It says nothing about whether there is such a hull.

    Attributes:
        scope: "read" or "write".
        name: the name asked for.
    """

    def __init__(self, scope: str, name: str) -> None:
        super().__init__(f"this token may not {scope} {name!r}")
        self.scope = scope
        self.name = name


@dataclass(frozen=True, slots=True)
class Access:
    """The prefixes of the names that a caller may read, and that it may write."""

    read: tuple[str, ...]
    write: tuple[str, ...]

    def require_read(self, name: str) -> None:
        """Raise PermissionDeniedError where the hull may not be read."""
        if not name.startswith(self.read):
            raise PermissionDeniedError("read", name)

    def require_write(self, name: str) -> None:
        """Raise PermissionDeniedError where the hull may not be written."""
        if not name.startswith(self.write):
            raise PermissionDeniedError("write", name)

    def readable(self, prefix: str) -> list[str]:
        """The prefixes of the readable names among those that begin with `prefix`: sorted, none part of another."""
        within = sorted({max(prefix, each, key=len) for each in self.read if _overlap(prefix, each)})
        return [each for i, each in enumerate(within) if not each.startswith(tuple(within[:i]))]


EVERYTHING = Access(("",), ("",))


def _overlap(a: str, b: str) -> bool:
    return a.startswith(b) or b.startswith(a)


class TokenEntry(BaseModel):
    """One [[token]] of the file."""

    model_config = ConfigDict(extra="forbid")

    name: str = ""
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    read: list[str] = []
    write: list[str] = []


class TokenTable(BaseModel):
    """The file."""

    model_config = ConfigDict(extra="forbid")

    token: list[TokenEntry] = []


class TokenFile:
    """Tokens from a TOML file of hashes, read again whenever it has changed.

    [[token]]
    name = "trucks"      # for people
    sha256 = "9f86d0..." # of the token, in hexadecimal digits
    read = ["fleet/"]    # prefixes of names; "" is every name
    write = ["fleet/truck-"]

    A file that has become unreadable or wrong is reported in the log, and the tokens stay as they were.

    Raises:
        ValueError: the file cannot be used. OSError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._version = self._current_version()
        self._tokens = self._load()

    def access(self, metadata: Mapping[str, Any]) -> Access:
        """What the caller with this metadata may do, or raise UnauthenticatedError."""
        self._reload()
        kind, _, token = str(metadata.get("authorization", "")).partition(" ")
        access = self._tokens.get(hashlib.sha256(token.strip().encode()).hexdigest())
        if kind.lower() != "bearer" or access is None:
            raise UnauthenticatedError
        return access

    def _reload(self) -> None:
        try:
            version = self._current_version()
            if version == self._version:
                return
            self._version = version
            self._tokens = self._load()
        except (OSError, ValueError) as error:
            log.error("the tokens stay as they were: %s", error)  # the message says it all
        else:
            log.info("tokens read again", extra={"tokens": len(self._tokens)})

    def _current_version(self) -> tuple[int, int, int]:
        stat = os.stat(self._path)  # noqa: PTH116  # each call pays for it
        return stat.st_mtime_ns, stat.st_size, stat.st_ino

    def _load(self) -> dict[str, Access]:
        try:
            table = TokenTable.model_validate(tomllib.loads(self._path.read_text("utf-8")))
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, first["loc"]))
            raise ValueError(f"{self._path}: {where}: {first['msg']}") from None
        except ValueError as error:
            raise ValueError(f"{self._path}: {error}") from None
        return {each.sha256: Access(tuple(each.read), tuple(each.write)) for each in table.token}
