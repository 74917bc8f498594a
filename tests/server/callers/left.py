"""A server whose caller leaves while the answer is under way; a program, for it sets up the logging of its process."""

import asyncio
import logging
import threading
import time

import grpc

from dynhull_server import logs

METHOD = "test.Service/Answer"


async def serve() -> None:
    begun, left = threading.Event(), threading.Event()

    async def answer(_: bytes, context: grpc.aio.ServicerContext[bytes, bytes]) -> None:
        begun.set()
        # Nothing else runs meanwhile, so that the answer comes before the cancellation.
        left.wait()
        time.sleep(0.2)  # the departure arrives
        try:
            await context.abort(grpc.StatusCode.NOT_FOUND, "nothing there")
        except grpc.aio.InternalError:
            # gRPC logs it in this way if it has not noticed the departure, which depends on threads of its own.
            logging.getLogger("grpc").exception("the answer failed")
            print("the answer failed")
            raise

    def leave(port: int) -> None:
        with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
            call = channel.unary_unary(f"/{METHOD}").future(b"")
            begun.wait()
            call.cancel()
            left.set()

    server = grpc.aio.server()
    handlers = {"Answer": grpc.unary_unary_rpc_method_handler(answer)}
    server.add_generic_rpc_handlers([grpc.method_handlers_generic_handler("test.Service", handlers)])
    port = server.add_insecure_port("127.0.0.1:0")
    await server.start()
    await asyncio.to_thread(leave, port)
    await server.stop(None)


if __name__ == "__main__":
    logs.configure("warning", "text")
    asyncio.run(serve())
