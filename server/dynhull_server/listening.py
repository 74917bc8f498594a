"""Why the server cannot listen on an address, in words."""

import errno
import socket


def why_not(host: str, port: int) -> str:
    """The operating system's reason why no address of the host can be listened on; empty if one of them can."""
    try:
        places = socket.getaddrinfo(host.strip("[]"), port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except OSError as error:
        return listening_error(error)
    reasons = []
    for family, kind, protocol, _, address in places:
        try:
            with socket.socket(family, kind, protocol) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as gRPC does
                probe.bind(address)
        except OSError as error:
            reasons.append(listening_error(error))
        else:
            return ""
    return reasons[0]


def listening_error(error: OSError) -> str:
    """The reason, and what to do if the port is in use."""
    if error.errno == errno.EADDRINUSE:
        return "another program uses this port: stop it, or choose another port"
    return error.strerror or str(error)
