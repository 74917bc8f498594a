"""Who calls: what a gateway, which has authenticated a caller, says of it to a worker.

Only the gateways can reach a worker: its sockets are in a folder of the server's own user, or callers must know the
secret of a cluster. The worker reads the
token file itself, so permissions that change apply there as in a server of one process.
"""

from collections.abc import Callable
from functools import lru_cache

from dynhull_server.rpc.access import EVERYTHING, Caller, TokenFile
from dynhull_server.rpc.calls import Call, Context

OWNER, KEY = "dynhull-owner", "dynhull-token-hash"
# What proves to a worker that others could reach, too, that a gateway calls.
PROOF = "dynhull-gateway-proof"
# In place of a hash: the caller is the gateway itself, which passes on to callers what they may read.
ITSELF = "gateway"

Metadata = tuple[tuple[str, str], ...]


def metadata_of(call: Call) -> Metadata:
    """The metadata that name the caller."""
    return ((OWNER, call.owner), (KEY, call.caller.key))


def metadata_of_feed(name: str) -> Metadata:
    """The metadata of a call for all who watch a hull. Each hull has its own limits."""
    return ((OWNER, f"{ITSELF}/{name}"), (KEY, ITSELF))


def authenticator(tokens: TokenFile | None) -> Callable[[Context], Caller]:
    """What returns the caller of a call from a gateway, or raises UnauthenticatedError if its token is gone."""

    def authenticate(context: Context) -> Caller:
        said = dict(context.invocation_metadata() or ())
        if tokens is None or said[KEY] == ITSELF:
            return _trusted(str(said[OWNER]))
        tokens.look()
        return tokens.known(str(said[KEY]))

    return authenticate


@lru_cache(maxsize=1024)
def _trusted(owner: str) -> Caller:
    return Caller(owner, EVERYTHING, for_others=True)
