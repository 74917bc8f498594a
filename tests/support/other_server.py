"""A plugin of pytest: the servers of the tests are those of the `dynhull` that OTHER_SERVER names.

`make upgrade` so runs the tests of one version on servers of another one, with `-p other_server`. The tests may be of
an earlier version, which does not have this file.
"""

import os

import mortal_server
import server_process


def pytest_collection_finish() -> None:
    """Replace what starts servers."""
    mortal_server.COMMAND = server_process.COMMAND = os.environ["OTHER_SERVER"]  # type: ignore[attr-defined]
