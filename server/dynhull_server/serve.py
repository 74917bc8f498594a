"""The command `dynhull serve`."""

from .flags import with_settings
from .settings import Settings


@with_settings
def serve(settings: Settings, _: dict[str, str]) -> None:
    """Serve hulls over gRPC.

    The first line printed is "dynhull serving on HOST:PORT". SIGTERM stops the server: calls in progress finish, and
    all others get UNAVAILABLE.

    A setting is taken from its flag, else from the environment (DYNHULL_PORT for --port), else from the --config file.
    """
    from .process import run

    run(settings)
