"""What a worker or a gateway runs, in the process that the supervisor has started for it."""

import asyncio
import os
import socket
from contextlib import suppress
from functools import partial
from pathlib import Path

from prometheus_client import generate_latest

from dynhull_server import event_loop, logs
from dynhull_server.failure import code_of, fail, text_of
from dynhull_server.garbage import few_collections
from dynhull_server.malloc import return_large_blocks
from dynhull_server.process import allow_connections, share_processors, stop_signal
from dynhull_server.settings import Settings
from dynhull_server.starting import started
from dynhull_server.storage.port import StorageError

from .line import ProcessLine
from .storages.choice import storage_kind
from .storages.kind import Begin, Serving


def main(end: socket.socket) -> None:
    """Serve until SIGTERM, or until the supervisor at the other end of the line has ended."""
    os.setpgid(0, 0)  # the signals of a terminal are for the supervisor
    try:
        event_loop.run(_run(end))
    except (OSError, RuntimeError, ValueError, StorageError) as error:
        fail(f"cannot serve: {text_of(error)}", code_of(error))


async def _run(end: socket.socket) -> None:
    line = await ProcessLine.on(end)
    begin = await line.receive()
    if begin is None:
        return
    settings = Settings.model_validate(begin["settings"])
    logs.configure(settings.log_level, settings.log_format, begin["process"])
    _name_process(begin["process"])
    return_large_blocks()
    share_processors(settings)
    allow_connections(settings.max_connections)
    with stop_signal() as stop, few_collections():
        served: asyncio.Future[Serving] = asyncio.get_running_loop().create_future()
        listening = asyncio.create_task(_listen(line, served))
        try:
            make = partial(_made, settings, begin)
            server = await started(make, lambda made: made.start(), stop, settings.start_patience)
            if server is None:
                return
            served.set_result(server)
            try:
                line.send({"serving": server.address})
                await stop.wait()
            finally:
                await server.drain()
        finally:
            listening.cancel()


async def _made(settings: Settings, begin: Begin) -> Serving:
    """What the process is to serve. Raises StorageError or ValueError if the storage cannot be used."""
    kind = storage_kind(settings)
    role, _, number = begin["process"].partition("-")
    return await (kind.worker(int(number), begin) if role == "worker" else kind.gateway(begin))


def _name_process(name: str) -> None:
    """Have the tools of the operating system show the name; without effect where it has no such file."""
    with suppress(OSError):
        Path("/proc/self/comm").write_text(name, "utf-8")


async def _listen(line: ProcessLine, served: "asyncio.Future[Serving]") -> None:
    """Answer the supervisor, and end with it: all acknowledged batches are stored."""
    while (asked := await line.receive()) is not None:
        page = await asyncio.to_thread(generate_latest, (await served).registry)
        line.send({"metrics": asked["metrics"], "page": page.decode()})
    os._exit(os.EX_UNAVAILABLE)
