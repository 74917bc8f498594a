"""The metrics page for Prometheus, in separate threads. It names hulls, so other machines must authenticate."""

import socket
import ssl
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from prometheus_client import CollectorRegistry
from prometheus_client.exposition import choose_encoder

from .access import Caller, PermissionDeniedError, UnauthenticatedError

# A connection that sends no request for this many seconds is closed, and so are more connections than this.
PATIENCE = 5.0
MOST_CONNECTIONS = 32


class MetricsPage:
    """Serves the page from `__init__` until `close`.

    Args:
        host: the address to listen on.
        port: the port to listen on; 0 for a free one.
        registry: the metrics.
        bearer: returns the caller for a value of the header Authorization, or raises UnauthenticatedError; None if no
            token is required.
        tls: the certificates; None for HTTP.
        refused: called in another thread with the reason, the status and the peer of each refused request.

    Attributes:
        url: its address.

    Raises:
        OSError: it cannot listen there.
    """

    def __init__(
        self,
        host: str,
        port: int,
        registry: CollectorRegistry,
        bearer: Callable[[str], Caller] | None,
        tls: ssl.SSLContext | None,
        refused: Callable[[str, str, str], None],
    ) -> None:
        class Page(_Page):
            def require(self) -> None:
                if bearer is not None:
                    bearer(self.headers.get("Authorization", "")).access.require_read("")

        Page.registry = registry
        Page.refused = staticmethod(refused)
        self._server = _Server(host, port, Page, tls)
        self._thread = threading.Thread(target=self._server.serve_forever, name="metrics")
        self._thread.start()
        self.url = f"{'http' if tls is None else 'https'}://{host}:{self._server.server_port}/metrics"

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Page(BaseHTTPRequestHandler):
    registry: CollectorRegistry
    refused: Callable[[str, str, str], None]
    timeout = PATIENCE

    def require(self) -> None:
        """Raise an error if the caller may not see the page."""

    def do_GET(self) -> None:
        """Serve the page under every path."""
        try:
            self.require()
        except (UnauthenticatedError, PermissionDeniedError) as error:
            unknown = isinstance(error, UnauthenticatedError)
            self.refused(str(error), "UNAUTHENTICATED" if unknown else "PERMISSION_DENIED", self.address_string())
            self.send_response(HTTPStatus.UNAUTHORIZED if unknown else HTTPStatus.FORBIDDEN)
            if unknown:
                self.send_header("WWW-Authenticate", "Bearer")
            self.end_headers()
            return
        encode, content_type = choose_encoder(self.headers.get("Accept", ""))
        page = encode(self.registry)
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", content_type)
        self.send_header("Content-Length", str(len(page)))
        self.end_headers()
        self.wfile.write(page)

    def log_message(self, *_: Any) -> None:
        """Log nothing: Prometheus sends a request every few seconds."""


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, host: str, port: int, page: type[_Page], tls: ssl.SSLContext | None) -> None:
        host = host.strip("[]")
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._tls = tls
        self._room = threading.BoundedSemaphore(MOST_CONNECTIONS)
        super().__init__((host, port), page)

    def process_request(self, request: Any, client_address: Any) -> None:
        if not self._room.acquire(blocking=False):
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except RuntimeError:  # the system has no more threads
            self._room.release()
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            if self._tls is not None:  # in this thread, because it waits for the client
                request.settimeout(PATIENCE)
                request = self._tls.wrap_socket(request, server_side=True)
        except OSError:  # the client has disconnected, or does not use TLS
            self.shutdown_request(request)
        else:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Log nothing: the client has disconnected."""
