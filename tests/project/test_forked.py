"""The processes of tests that are forked start fast because they have imported all they need before."""

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import forked
import pytest
from cases import slow

from dynhull_cluster import child_process
from dynhull_cluster.storages.choice import storage_kind
from dynhull_server.settings import Settings

SERVE = f"""
import sys
sys.path.insert(0, {str(Path(forked.__file__).parent)!r})
import forked
import pytest
command = [forked.COMMAND, "serve", "--port", "0", "--in-memory"]
forked.import_for(command)
print("forked", file=sys.stderr)
sys.argv = command
from dynhull_cli.main import main
main()
"""


@slow
def test_a_server_imports_nothing_of_ours_after_the_fork() -> None:
    """Once a module that it runs was missing there: each of a thousand servers took three times as long."""
    command = [sys.executable, "-X", "importtime", "-c", SERVE]
    with (
        TemporaryFile("w+") as imported,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=imported, text=True) as process,
    ):
        assert process.stdout.readline().startswith("dynhull serving")
        process.terminate()
        process.wait()
        imported.seek(0)
        lines = imported.read().splitlines()
    after = (line.split("|")[-1].strip() for line in lines[lines.index("forked") :])
    assert [module for module in after if module.startswith("dynhull")] == []


MADE = """
import asyncio, json, sys
from importlib import import_module

settings, roles, modules = json.loads(sys.argv[1])
for module in modules:
    import_module(module)
before = set(sys.modules)

from dynhull_cluster.storages.choice import storage_kind
from dynhull_server.settings import Settings

async def make():
    kind, begin = storage_kind(Settings(**settings)), {"sockets": "sockets", "site": "here"}
    for role in roles:
        await (kind.worker(0, begin) if role == "worker" else kind.gateway(begin))

asyncio.run(make())
print([module for module in sys.modules if module not in before and module.startswith("dynhull")])
"""


@slow
@pytest.mark.parametrize(
    ("settings", "roles"),
    [
        ({"data": "data"}, ["worker", "gateway"]),
        ({"journal": "postgresql://host/hulls"}, ["worker"]),
    ],
    ids=["folder", "postgresql"],
)
def test_a_process_of_several_imports_nothing_of_ours_after_the_fork(
    settings: dict[str, Any], roles: list[str]
) -> None:
    modules = [*child_process.IMPORTED, *storage_kind(Settings(**settings)).preloads]
    command = [sys.executable, "-c", MADE, json.dumps([settings, roles, modules])]
    made = subprocess.run(command, capture_output=True, text=True, check=True)
    assert made.stdout == "[]\n"
