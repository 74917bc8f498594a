"""What a forked process inherits of the SDK: nothing of it waits for ever there, and the parent goes on."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from forked import Process

from dynhull_client import HullClient

PROGRAM = """
import json, os, sys
from dynhull_client import HullClient

address, name = sys.argv[1:]
client = HullClient(address, timeout=20)

def said(call):
    try:
        return str(call())
    except Exception as error:
        return f"{type(error).__name__}: {error}"

def fork(calls):
    child = os.fork()
    if not child:
        print(json.dumps({what: said(call) for what, call in calls.items()}), flush=True)
        os._exit(0)  # as multiprocessing does: gRPC may hang where Python takes its objects apart
    assert os.waitpid(child, 0)[1] == 0

client.apply(name, insert=[[0, 0]])
fork({
    "points": lambda: client.get_hull(name).info.points,
    "new writer": lambda: client.writer(name, producer="child").put([[1, 1]]).result().points,
    "close": client.close,
    "after": lambda: client.get_hull(name),
})
with client.writer(name, producer="closed") as closed:
    closed.put([[1, 0]])
watch = client.watch(name)
next(watch)
pipeline = client.pipeline()
pipeline.count(name, [[0, 0]]).result()
ingest = client.ingest(name).__enter__()
writer = client.writer(name, producer="p")
writer.put([[2, 2]]).result()
fork({
    "closed": closed.close,
    "put": lambda: writer.put([[9, 9]]),
    "flush": writer.flush,
    "close": writer.close,
    "mistake": lambda: writer.__exit__(LookupError, LookupError(), None),
    "get": lambda: pipeline.get_hull(name),
    "pipeline flush": pipeline.flush,
    "pipeline close": pipeline.close,
    "next": lambda: next(watch),
    "watch close": watch.close,
    "apply": lambda: ingest.apply([[9, 9]]),
    "ingest end": lambda: ingest.__exit__(None, None, None),
    "points": lambda: client.get_hull(name),
    "new client": lambda: HullClient(address).get_hull(name),
    "client close": client.close,
})
ingest.apply([[3, 3]])
ingest.__exit__(None, None, None)
writer.put([[4, 4]])
writer.close()
points = pipeline.get_hull(name).result().info.points
pipeline.close()
while next(watch).points < points:
    pass
watch.close()
print(json.dumps(points))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on this system")
def test_a_forked_child_waits_for_nothing_of_its_parent(address: str, name: str, tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    command = [sys.executable, str(program), address, name]
    with HullClient(address) as client:
        client.create_hull(name)
    with Process(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            output, errors = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 0, errors
    idle, amid, points = map(json.loads, output.splitlines())
    assert idle == {
        "points": "1",
        "new writer": "2",
        "close": "None",
        "after": "DynhullError: the client is closed",
    }
    ours = [
        *(("writer", call) for call in ("put", "flush", "close")),
        *(("pipeline", call) for call in ("get", "pipeline flush", "pipeline close")),
        *(("ingest", call) for call in ("apply", "ingest end")),
        ("watch", "next"),
    ]
    for what, call in ours:
        said = amid.pop(call)
        assert said.startswith(f"RuntimeError: the {what} belongs to process {process.pid}"), call
        assert "'spawn' or 'forkserver'" in said
    for call in ("points", "new client"):
        assert amid.pop(call).startswith("RuntimeError: this process was forked while a "), call
    assert amid == {"closed": "None", "mistake": "None", "watch close": "None", "client close": "None"}
    assert points == 6
