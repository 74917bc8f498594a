"""Addresses of databases, as the user gives them."""

import re
from pathlib import Path

PASSWORD = re.compile(r"(://[^:/?@]*:|\bpassword=)[^@&\s]*")


def without_password(address: str) -> str:
    """The address of a database as it may be shown."""
    return PASSWORD.sub(r"\1***", address)


def is_database(folder: Path) -> bool:
    """Whether what was given as a folder is the address of a database."""
    return folder.parts[:1] in {("postgresql:",), ("postgres:",)}
