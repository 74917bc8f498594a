"""The settings of `dynhull gateway`, from its command line."""

from dataclasses import dataclass, field

from .page import PageSettings


@dataclass(frozen=True, slots=True)
class Settings:
    """Limits, and what is allowed.

    Attributes:
        origins: the origins whose pages may read answers (CORS); "*" for all.
        hosts: the names under which the gateway answers; none for any.
        max_body: bytes of a body that is read as a whole: JSON and GeoJSON.
        max_upload: bytes of a body of rows.
        head_seconds: seconds within which a request must have arrived up to its body.
        body_seconds: seconds within which more of a body must arrive, and within which a body that is read as a whole
            must have arrived.
        reader_seconds: seconds within which a caller must read some of what waits for it.
        keepalive_seconds: seconds without an event after which a comment is sent on a stream of events.
        max_streams: streams of events at a time.
        max_many_streams_per_caller: those of many hulls, per token, or without tokens per address.
        max_subscriptions: streams that are joined to one.
        grace_seconds: seconds that requests may still take after SIGTERM.
        root_path: the path below which a proxy shows the gateway.
        forwarded_from: the addresses of proxies whose forwarded headers are believed, with commas between.
        metrics: host and port of the page for Prometheus; None for no such page.
        page: what the dashboard shows.
        names: the names, with their ports, to which a dashboard alone answers; none for a gateway.
        read_only: whether it is a dashboard: a gateway that changes nothing, with the page at its own address.
    """

    origins: tuple[str, ...] = ()
    hosts: frozenset[str] = frozenset()
    max_body: int = 16 * 2**20
    max_upload: int = 2**30
    head_seconds: float = 10.0
    body_seconds: float = 30.0
    reader_seconds: float = 30.0
    keepalive_seconds: float = 15.0
    max_streams: int = 10_000
    max_many_streams_per_caller: int = 256
    max_subscriptions: int = 1_000
    grace_seconds: float = 10.0
    root_path: str = ""
    forwarded_from: str = "127.0.0.1"
    metrics: tuple[str, int] | None = None
    page: PageSettings = field(default_factory=PageSettings)
    names: frozenset[str] = frozenset()
    read_only: bool = False
