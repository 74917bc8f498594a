"""SQLite, and the disk that it is on: its result codes (sqlite.org/rescode.html), and the `errno` of the disk's own."""

import errno
import sqlite3

from ..refusals import Meaning, Refusals

PRIMARY = 0xFF  # an extended result code is this part, and what it says more exactly

SQLITE = Refusals(
    {
        Meaning.PASSES: {
            sqlite3.SQLITE_BUSY: "another process has locked the database",
            sqlite3.SQLITE_FULL: "the disk is full",
            sqlite3.SQLITE_INTERRUPT: "interrupted",
            sqlite3.SQLITE_LOCKED: "another connection has locked a table",
            sqlite3.SQLITE_NOMEM: "no memory",
            sqlite3.SQLITE_PROTOCOL: "others lock the log in turn",
        },
        Meaning.DOUBTFUL: {
            sqlite3.SQLITE_CANTOPEN: "a file cannot be opened: no descriptors, or no rights",
            sqlite3.SQLITE_IOERR: "the disk fails, or a network that it is behind",
        },
        Meaning.FINAL: {
            sqlite3.SQLITE_AUTH: "no rights",
            sqlite3.SQLITE_CORRUPT: "damaged",
            sqlite3.SQLITE_FORMAT: "no database",
            sqlite3.SQLITE_NOLFS: "the disk has no files of this size",
            sqlite3.SQLITE_NOTADB: "no database",
            sqlite3.SQLITE_PERM: "no rights",
            sqlite3.SQLITE_READONLY: "the file or its folder may not be written",
            sqlite3.SQLITE_TOOBIG: "a value is too large",
        },
    },
    otherwise=Meaning.FINAL,
)

DISK = Refusals(
    {
        Meaning.PASSES: {
            errno.EAGAIN: "locked",
            errno.EBUSY: "in use",
            errno.EDQUOT: "the quota is used up",
            errno.EMFILE: "no descriptors left in the process",
            errno.ENFILE: "no descriptors left in the system",
            errno.ENOLCK: "no locks left",
            errno.ENOMEM: "no memory",
            errno.ENOSPC: "the disk is full",
        },
        Meaning.DOUBTFUL: {
            errno.EIO: "the disk fails",
            errno.ESTALE: "the disk behind a network was mounted anew",
            errno.ETIMEDOUT: "the disk behind a network does not answer",
        },
    },
    otherwise=Meaning.FINAL,
)


def meaning_of(error: BaseException) -> Meaning:
    """The meaning of an error of SQLite, of the disk or of memory."""
    if isinstance(error, OSError):
        return DISK.meaning(error.errno)
    if isinstance(error, MemoryError):
        return Meaning.PASSES
    code = getattr(error, "sqlite_errorcode", None)  # an error of the module itself has none
    return SQLITE.meaning(code, None if code is None else code & PRIMARY)
