"""Servers that do not know most calls of this version."""

from collections.abc import Iterator
from concurrent import futures
from contextlib import contextmanager
from socketserver import StreamRequestHandler, ThreadingTCPServer
from threading import Thread
from typing import Any

import grpc
from grpc_status.rpc_status import to_status

from dynhull_server.rpc.status import MethodUnknownError, error_status


class _Known(grpc.GenericRpcHandler):
    """Answers the call with which a writer begins, and no other."""

    def service(self, details: grpc.HandlerCallDetails) -> Any:
        if details.method != "/dynhull.v1.HullService/GetProducer":
            return None
        return grpc.unary_unary_rpc_method_handler(lambda *_: b"")


class _Unknown(grpc.GenericRpcHandler):
    """Refuses all methods as `dynhull serve` does."""

    def service(self, _: grpc.HandlerCallDetails) -> Any:
        def refuse(_: object, context: grpc.ServicerContext) -> None:
            context.abort_with_status(to_status(error_status(MethodUnknownError())))

        return grpc.stream_stream_rpc_method_handler(refuse)


@contextmanager
def older_server(*, says_so: bool = True) -> Iterator[str]:
    """A server with one method, which refuses others in its own words or leaves that to gRPC; yields its address."""
    running = grpc.server(futures.ThreadPoolExecutor(4))
    running.add_generic_rpc_handlers((_Known(), _Unknown()) if says_so else (_Known(),))
    port = running.add_insecure_port("127.0.0.1:0")
    running.start()
    try:
        yield f"127.0.0.1:{port}"
    finally:
        running.stop(None).wait()


class _NotFound(StreamRequestHandler):
    """Answers the first request of a connection with the status 404 of HTTP/2 (RFC 9113), and no other."""

    def handle(self) -> None:
        self.rfile.read(24)  # the preface
        self.wfile.write(b"\0\0\0\x04\0\0\0\0\0")  # SETTINGS
        while True:
            header = self.rfile.read(9)
            if not header:
                return
            self.rfile.read(int.from_bytes(header[:3]))
            if header[3] == 1:  # HEADERS
                self.wfile.write(b"\0\0\x01\x01\x05" + header[5:] + b"\x8d")


@contextmanager
def no_grpc_server() -> Iterator[str]:
    """A web server that has nothing at the paths of gRPC; yields its address."""
    with ThreadingTCPServer(("127.0.0.1", 0), _NotFound) as running:
        running.daemon_threads = True
        Thread(target=running.serve_forever, args=(0.01,), daemon=True).start()
        yield f"127.0.0.1:{running.server_address[1]}"
        running.shutdown()
