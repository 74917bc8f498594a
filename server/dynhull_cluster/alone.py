"""What the only process of a server serves: hulls in a folder, in memory, or in a database."""

from dynhull_server.app import Server
from dynhull_server.process import Alone
from dynhull_server.settings import Settings

from .divisions.divisions import ServedDivisions
from .journal import database_of


async def serving_alone(settings: Settings) -> Alone:
    """What the process is to serve.

    Raises:
        ValueError: the address of the database is invalid, or the package for PostgreSQL is missing.
    """
    if settings.journal is None:
        return Server(settings, divisions=ServedDivisions(settings))
    database = database_of(settings)  # before what needs its package
    from .machines.only_member import OnlyMember

    return OnlyMember(settings, database)
