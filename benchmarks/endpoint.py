"""An HTTP endpoint for benchmarks: prints its port, and at SIGTERM each event that it got, with the time.

The lines have the id of the event, the revision of its subject's hull, and seconds of the machine's monotonic clock.
"""

import asyncio
import json
import signal
import time

from aiohttp import web


async def main() -> None:
    received: list[tuple[float, bytes]] = []

    async def take(request: web.Request) -> web.Response:
        body = await request.read()
        received.append((time.monotonic(), body))  # read later: an endpoint that counts is not what is measured
        return web.Response(status=204)

    application = web.Application(client_max_size=2**30)
    application.router.add_post("/{fence:.*}", take)
    runner = web.AppRunner(application, access_log=None)
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", 0)
    await site.start()
    print(runner.addresses[0][1], flush=True)
    stop = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stop.set)
    await stop.wait()
    await runner.cleanup()
    for at, body in received:
        found = json.loads(body)
        for event in found if isinstance(found, list) else [found]:
            print(event["id"], event["data"].get("revision", 0), at)


if __name__ == "__main__":
    asyncio.run(main())
