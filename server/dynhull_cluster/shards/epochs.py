"""The epochs of roots: each is greater than those of all roots of the hull before, and no two roots have the same."""

from .logs import FencedError

# The bits of an epoch below the number of the owner.
OWNER_BITS = 32


class Epochs:
    """The epochs of the roots that one owner of a log of decisions begins, one after the other.

    A root that was replaced may not know so yet, and go on. Its number must not be that of the next one, nor greater:
    shards would take the messages of both, or go back to what it knows as decided. So the number of the owner is the
    upper part of the epoch.

    Args:
        owner: a number greater than those of all owners before; 0 for a log that nobody can own while a former owner
            may go on.
    """

    def __init__(self, owner: int) -> None:
        self._owner = owner
        self._last = owner << OWNER_BITS

    def next(self, known: int) -> int:
        """The next epoch.

        Args:
            known: the greatest that shards know of.

        Raises:
            FencedError: a later owner has begun.
        """
        last = max(self._last, known)
        if self._owner and owner_of(last) > self._owner:
            raise FencedError("a shard knows of a later root")
        self._last = last + 1
        return self._last


def owner_of(epoch: int) -> int:
    """The number of the owner in an epoch."""
    return epoch >> OWNER_BITS
