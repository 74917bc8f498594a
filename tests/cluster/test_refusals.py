"""What PostgreSQL refuses at the start of a server is waited for if it passes, and ends the server if it is final."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import NoReturn

import psycopg
import pytest
from cases import slow
from forked import COMMAND
from logged_process import Logged, logged_process, require_service
from postgresql import FAST, PostgreSQL, postgresql

from dynhull_cluster.postgres.refusals import meaning_of
from dynhull_server.storage.refusals import Meaning

SHAPES = {"one process": (), "workers": ("--workers", "2"), "cluster": ("--cluster", "--partitions", "2")}


@pytest.fixture(scope="module")
def server() -> Iterator[PostgreSQL]:
    with postgresql(*FAST, "max_connections=40") as server:
        yield server


@contextmanager
def serving(url: str, *options: str) -> Iterator[Logged]:
    command = (COMMAND, "serve", "--port", "0", "--log-format", "json", "--scrub-cpu", "0", "--journal", url)
    with logged_process([*command, *options]) as logged:
        yield logged


@slow
def test_a_database_that_recovers_is_waited_for(server: PostgreSQL) -> None:
    urls = [server.new_database() for _ in SHAPES]
    server.kill()
    with ExitStack() as stack:
        with server.recovering():
            started = [
                stack.enter_context(serving(url, *options)) for url, options in zip(urls, SHAPES.values(), strict=True)
            ]
            for logged in started:
                said = logged.wait_for("cannot serve yet")
                assert "the database system is " in said["reason"]
                assert said["pause"] > 0
        for logged in started:
            require_service(logged)


def test_a_server_that_waits_ends_when_it_is_told_to(server: PostgreSQL) -> None:
    with connections(server), serving(server.url("postgres"), "--workers", "1") as logged:
        logged.wait_for("cannot serve yet")


def test_connections_are_waited_for(server: PostgreSQL) -> None:
    url = server.new_database()
    with ExitStack() as stack:
        with connections(server):
            logged = stack.enter_context(serving(url))
            assert "too many clients already" in logged.wait_for("cannot serve yet")["reason"]
        require_service(logged)


@contextmanager
def connections(server: PostgreSQL) -> Iterator[None]:
    """All connections that the server has."""
    with ExitStack() as stack:

        def use_up() -> NoReturn:
            while True:
                stack.enter_context(psycopg.connect(server.url("postgres")))

        with pytest.raises(psycopg.OperationalError, match="too many clients"):
            use_up()
        yield


FAILED = 'connection failed: connection to server on socket "/run/.s.PGSQL.5432" failed: '
PASSES, DOUBTFUL, FINAL = Meaning


@pytest.mark.parametrize(
    ("said", "meaning"),
    [
        ("FATAL:  the database system is starting up", PASSES),
        ("FATAL:  the database system is not yet accepting connections\nDETAIL:  Consistent recovery state", PASSES),
        ("FATAL:  the database system is in recovery mode", PASSES),
        ('FATAL:  too many connections for role "north"', PASSES),
        ("FATAL:  remaining connection slots are reserved for non-replication superuser connections", PASSES),
        ("FATAL:  das Datenbanksystem startet", DOUBTFUL),
        ("Connection refused\n\tIs the server running on that host?", DOUBTFUL),
        ("server closed the connection unexpectedly", DOUBTFUL),
        ("session is read-only", DOUBTFUL),
        ('FATAL:  password authentication failed for user "north"', FINAL),
        ("fe_sendauth: no password supplied", FINAL),
        ('FATAL:  database "hulls" does not exist\nDETAIL:  It seems to have just been dropped.', FINAL),
        ('FATAL:  role "north" does not exist', FINAL),
        ('FATAL:  no pg_hba.conf entry for host "10.0.0.1", user "north", database "hulls"', FINAL),
    ],
)
def test_what_a_refused_connection_means(said: str, meaning: Meaning) -> None:
    assert meaning_of(psycopg.OperationalError(FAILED + said)) is meaning


@pytest.mark.parametrize(
    ("error", "meaning"),
    [
        (psycopg.errors.AdminShutdown, PASSES),
        (psycopg.errors.DiskFull, PASSES),
        (psycopg.errors.TooManyConnections, PASSES),
        (psycopg.errors.SerializationFailure, PASSES),
        (psycopg.errors.IoError, DOUBTFUL),
        (psycopg.errors.InsufficientPrivilege, FINAL),
        (psycopg.errors.DatabaseDropped, FINAL),
        (psycopg.errors.UndefinedTable, FINAL),
    ],
)
def test_what_an_error_means(error: type[psycopg.Error], meaning: Meaning) -> None:
    assert meaning_of(error("")) is meaning


def test_several_hosts_refuse_for_good_if_one_does() -> None:
    said = f"{FAILED}Connection refused\n{FAILED}FATAL:  password authentication failed for user"
    assert meaning_of(psycopg.OperationalError(said)) is FINAL
