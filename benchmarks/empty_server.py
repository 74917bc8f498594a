"""The fastest handlers that grpcio allows: they read, acknowledge and do nothing else. `server.py` measures them.

gRPC has the options and the event loop of our server, so that only the handlers differ. With a port as the last
argument, several of these processes share it.
"""

import sys

import grpc

from dynhull_server import event_loop
from dynhull_server.entrance import grpc_server
from dynhull_server.settings import Settings

ACKNOWLEDGEMENT = b"\x0a\x02\x08\x01"


async def stream(_, context):
    while await context.read() is not grpc.aio.EOF:
        await context.write(ACKNOWLEDGEMENT)


async def unary(_request, _context):
    return ACKNOWLEDGEMENT


async def main() -> None:
    server = grpc_server(Settings(), shared_port=True)
    handlers = {
        "Stream": grpc.stream_stream_rpc_method_handler(stream),
        "Locate": grpc.unary_unary_rpc_method_handler(unary),
    }
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("dynhull.v1.HullService", handlers),))
    port = server.add_insecure_port(f"127.0.0.1:{sys.argv[-1] if sys.argv[-1].isdecimal() else 0}")
    await server.start()
    print(f"empty serving on 127.0.0.1:{port}", flush=True)
    await server.wait_for_termination()


if __name__ == "__main__":
    event_loop.run(main())
