"""The page for Prometheus that bridges serve."""

import errno

from prometheus_client import CollectorRegistry, start_http_server


def serve_page(registry: CollectorRegistry, host: str, port: int) -> int:
    """Serve the page from another thread, and return its port; OSError in words if nothing can listen there."""
    try:
        server, _ = start_http_server(port, host, registry)
    except OSError as error:
        why = error.strerror or str(error)
        if error.errno == errno.EADDRINUSE:
            why = "another program uses this port: stop it, or choose another port, 0 for a free one"
        raise OSError(f"--metrics-port {port}: cannot listen on {host}: {why}") from None
    return int(server.server_port)
