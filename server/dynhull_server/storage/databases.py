"""The kinds of databases that `--journal` takes, by the scheme of their URL, and addresses as the user gives them.

A new kind is a module of `dynhull_cluster/storages/` and a line in DATABASES.
"""

import re
from pathlib import Path
from typing import NamedTuple

PASSWORD = re.compile(r"(://[^:/?@]*:|\bpassword=)[^@&\s]*")


class DatabaseKind(NamedTuple):
    """A kind of database.

    Attributes:
        name: what it is called.
        example: an address.
        served_by: the `StorageKind` that serves hulls in it, as "package.module:class"; imported when it is used.
    """

    name: str
    example: str
    served_by: str


POSTGRESQL = DatabaseKind(
    "PostgreSQL", "postgresql://user@host/database", "dynhull_cluster.storages.postgresql:PostgresKind"
)
DATABASES = {
    "postgresql": POSTGRESQL,
    "postgres": POSTGRESQL,
}


def names() -> str:
    """What all kinds are called, for help."""
    return " or ".join(dict.fromkeys(kind.name for kind in DATABASES.values()))


def examples() -> str:
    """An address of each kind, for help and errors."""
    return " or ".join(dict.fromkeys(kind.example for kind in DATABASES.values()))


def kind_of(address: str) -> DatabaseKind:
    """The kind of database at an address: a URL, or the keywords of libpq, which have no scheme.

    Raises:
        ValueError: there is no such kind.
    """
    scheme, mark, _ = address.partition("://")
    if not mark:
        return POSTGRESQL
    if scheme not in DATABASES:
        raise ValueError(f"{scheme}:// is no database that can have hulls: write {examples()}")
    return DATABASES[scheme]


def is_database(folder: Path) -> bool:
    """Whether what was given as a folder is the address of a database."""
    return any(folder.parts[:1] == (f"{scheme}:",) for scheme in DATABASES)


def without_password(address: str) -> str:
    """The address of a database as it may be shown."""
    return PASSWORD.sub(r"\1***", address)
