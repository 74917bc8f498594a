"""The command `dynhull serve`."""

from dynhull_server.flags import with_settings
from dynhull_server.settings import Settings


@with_settings
def serve(settings: Settings, _: dict[str, str]) -> None:
    """Serve hulls over gRPC.

    The first line printed is "dynhull serving on HOST:PORT". SIGTERM stops the server: calls in progress finish, and
    all others get UNAVAILABLE.

    With --workers, several processes share the hulls by the first part of their names, up to the first "/". SIGHUP then
    restarts them, one at a time.

    With --cluster, servers on any machines share the hulls of a PostgreSQL database: start each with the same command.

    A setting is taken from its flag, else from the environment (DYNHULL_PORT for --port), else from the --config file.
    """
    if settings.workers is None and not settings.cluster:
        from dynhull_server.process import Alone
        from dynhull_server.process import run as run_one

        from .storages.choice import storage_kind

        async def alone() -> Alone:
            return storage_kind(settings).alone()

        run_one(settings, alone)
    else:
        from .process import run

        run(settings)
