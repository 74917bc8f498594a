"""What the disk refuses, and what it lost."""


class JournalError(Exception):
    """The journal cannot be used; the message says why and what to do."""


class JournalLockedError(JournalError):
    """Another server works on this folder."""


class JournalFormatError(JournalError):
    """The folder was written by a newer version, or is no journal at all."""


class JournalDamagedError(JournalError):
    """A record in the middle is not what was written."""


class JournalFullError(JournalError):
    """There is no room on the disk; nothing of the commit was written."""
