"""A cluster on a physical copy of the database of another one, which serves: its tables name the owners of that one."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from cases import slow
from command_line import dynhull
from postgresql import PostgreSQL, postgresql
from psycopg.conninfo import conninfo_to_dict
from server_process import server_process

from dynhull_client import HullClient

pytestmark = pytest.mark.one_process("a cluster has a shape of its own")

NAMES = [f"{first}/hull" for first in "abcdefgh"]


def machine(url: str) -> tuple[str, ...]:
    """The options of a server."""
    return ("--cluster", "--partitions", "4", "--journal", url, "--scrub-cpu", "0", "--create-on-write")


@pytest.fixture
def original() -> Iterator[PostgreSQL]:
    """A PostgreSQL server of this test's own: all of its databases are copied."""
    with postgresql() as server:
        yield server


@slow
def test_nothing_of_a_copy_arrives_at_the_owners_of_the_original(original: PostgreSQL) -> None:
    url = original.new_database()
    with ExitStack() as stack:
        serving = stack.enter_context(server_process(*machine(url)))
        client = stack.enter_context(HullClient(serving.address, retries=0))
        assert [client.apply(name, insert=[[1, 1]]).points for name in NAMES] == [1] * len(NAMES)
        copied = stack.enter_context(postgresql(copied=original)).url(conninfo_to_dict(url)["dbname"])
        shown = dynhull("cluster", "status", "--journal", copied).stdout
        assert "/0  not connected to this database  4: 0, 1, 2, 3\n" in shown
        said = "To join them, give --journal the database that they serve"
        beside = stack.enter_context(server_process(*machine(copied), complaints=said))
        other = stack.enter_context(HullClient(beside.address, retries=0))
        assert [other.apply(name, insert=[[2, 2]]).points for name in NAMES] == [2] * len(NAMES)
        assert [client.get_hull(name).info.points for name in NAMES] == [1] * len(NAMES)
        assert [client.apply(name, insert=[[3, 3], [4, 4]]).points for name in NAMES] == [3] * len(NAMES)
        assert [other.get_hull(name).info.points for name in NAMES] == [2] * len(NAMES)
