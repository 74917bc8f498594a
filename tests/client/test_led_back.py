"""Writers notice that a hull was led back, though its server cannot: as by a snapshot of its whole disk."""

import shutil
from contextlib import ExitStack
from pathlib import Path

import pytest
from client_kinds import CLIENTS
from mortal_server import MortalServer

from dynhull_client import RestoredError
from dynhull_server.storage.sqlite.origin import NOTE

KEPT = 2


def put(hull: str, writer, number: int) -> None:
    """Put a point, as a batch of its own."""
    writer.put([[number, number**2]], **({"sequence": 10 * number} if hull.startswith("skips") else {}))
    writer.flush()


@pytest.mark.one_process("the folder is that of one process")
def test_writers_have_numbers_that_a_hull_has_lost(tmp_path: Path) -> None:
    server, folder, earlier = MortalServer(tmp_path), tmp_path / "data", tmp_path / "earlier"
    with ExitStack() as stack:
        stack.callback(lambda: server.kill())
        writers, clients = {}, {}
        for kind, connect in CLIENTS.items():
            client = stack.enter_context(connect(server.address))
            for name in ("counts", "skips"):
                hull = f"{name}/{kind}"
                clients[hull] = client
                client.create_hull(hull)
                writers[hull] = client.writer(hull, producer=name, may_skip=name == "skips")
                for number in range(1, KEPT + 1):
                    put(hull, writers[hull], number)
        server.kill()
        shutil.copytree(folder, earlier)
        server.start()
        for hull, writer in writers.items():
            put(hull, writer, KEPT + 1)
        server.kill()
        shutil.rmtree(folder)
        shutil.copytree(earlier, folder, ignore=shutil.ignore_patterns(NOTE))
        server.start()
        for hull, writer in writers.items():
            with pytest.raises(RestoredError) as caught:
                put(hull, writer, KEPT + 2)
            assert caught.value.last == (10 * KEPT if hull.startswith("skips") else KEPT)
            assert caught.value.uid == writer.uid
            known = {"uid": writer.uid, "acknowledged": writer.sequence}
            with pytest.raises(RestoredError), clients[hull].writer(hull, producer=hull.partition("/")[0], **known):
                pass
