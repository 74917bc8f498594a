"""PostgreSQL: SQLSTATEs (PostgreSQL, appendix A), whole or by their class, which is the first two characters.

libpq has no SQLSTATE for a connection that is refused, but the words of the server and its own. They are known here in
English; what a server says in another language is doubtful. It has the setting `lc_messages`, which clients cannot
change before they are admitted.
"""

import re
from collections.abc import Iterator

import psycopg

from dynhull_server.storage.refusals import Meaning, Refusals

POSTGRESQL = Refusals(
    {
        Meaning.PASSES: {
            "08": "the connection is lost",
            "40": "a transaction was rolled back for the sake of another one",
            "53": "no room on the disk, no memory, too many connections",
            "55006": "an object is in use",
            "55P03": "a lock is not available",
            "57": "ended by its administrator or a crash, or it starts",
        },
        Meaning.DOUBTFUL: {
            None: "it cannot be reached, or speaks another language",
            "25006": "a standby, which may be promoted, or read-only",
            "55000": "the database takes no connections at present",
            "58": "its disk fails",
            "XX000": "an internal error",
        },
        Meaning.FINAL: {
            "28": "a wrong user or password, or not from here",
            "3D000": "no such database",
            "42501": "no rights",
            "57P04": "the database was dropped",
            "XX001": "damaged data",
            "XX002": "a damaged index",
        },
    },
    otherwise=Meaning.FINAL,
)

# What refused connections say, with the code that it stands for.
WORDS = {
    "the database system is starting up": "57P03",
    "the database system is shutting down": "57P03",
    "the database system is in recovery mode": "57P03",
    "the database system is not yet accepting connections": "57P03",
    "terminating connection due to administrator command": "57P01",
    "too many clients already": "53300",
    "remaining connection slots are reserved": "53300",
    "too many connections for": "53300",
    "authentication failed for user": "28P01",
    "no password supplied": "28P01",
    "no pg_hba.conf entry": "28000",
    "pg_hba.conf rejects connection": "28000",
    "is not permitted to log in": "28000",
    "session is read-only": "25006",
    "permission denied for database": "42501",
}
MISSING = re.compile('(database|role) ".*" does not exist')


def meaning_of(error: psycopg.Error) -> Meaning:
    """The meaning of an error; where several hosts have refused a connection, the least hopeful one."""
    if error.sqlstate is not None:
        return _meaning(error.sqlstate)
    return max(map(_meaning, _codes(" ".join(str(error).split()))), default=_meaning(None))


def _meaning(code: str | None) -> Meaning:
    return POSTGRESQL.meaning(code, code and code[:2])


def _codes(said: str) -> Iterator[str]:
    yield from (code for words, code in WORDS.items() if words in said)
    if found := MISSING.search(said):
        yield "3D000" if found[1] == "database" else "28000"
