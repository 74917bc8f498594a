"""The shards of hulls as the storage of this process keeps them."""

from functools import partial
from typing import Any

from ..state.records import Create, Delete, HullRow, Kept
from ..storage.port import NotCommittedError, Storage
from .driver import Driver


class ShardStore:
    """Creates, reads and deletes shards; the methods that are not coroutines are called from threads of shards.

    Args:
        driver: commits.
        storage: keeps the shards.
    """

    def __init__(self, driver: Driver, storage: Storage) -> None:
        self._driver = driver
        self._storage = storage

    @property
    def keeps(self) -> bool:
        """Whether the storage keeps batches."""
        return self._storage.keeps

    @property
    def epoch(self) -> int:
        """The epoch of this server as the owner of its storage; 0 where it has none."""
        return self._storage.epoch

    def entitled(self) -> bool:
        """Whether no other server may have other hulls."""
        return self._storage.entitled()

    async def add(self, row: HullRow) -> None:
        """Create a shard, unless an earlier attempt has, whose outcome was not known."""
        await self._commit_unless([Create(row)], row.number, there=True)

    async def drop(self, number: int) -> None:
        """Delete a shard, unless an earlier attempt has."""
        await self._commit_unless([Delete(number)], number, there=False)

    def read(self, number: int) -> Kept:
        """A shard as it is stored, after the outcomes of all commits are decided."""
        self.commit([])
        return self._storage.read(number)

    def cut(self, number: int, last: int) -> Any:
        """What drops the revisions of a shard after `last`; None for nothing."""
        return self._storage.cut(number, last)

    def commit(self, changes: list[Any]) -> None:
        """Commit changes; raises the error of a failure."""
        self._driver.commit_from_thread(changes)

    async def _commit_unless(self, changes: list[Any], number: int, *, there: bool) -> None:
        """Commit changes of which shards there are; what does not take effect may have done so before."""
        if not self.keeps:
            return
        try:
            await self._driver.commit(changes)
        except NotCommittedError:
            row = await self._driver.on_disk(partial(self._storage.row, number))
            if (row is not None) != there:
                raise
