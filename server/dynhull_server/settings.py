"""The settings of the server, defined once for flags, environment, file and help."""

import ipaddress
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from .storage.databases import examples, is_database, kind_of, names
from .storage.durability import Durability
from .storage.segments.place import is_store, require_store

PREFIX = "DYNHULL_"  # of environment variables
# Former names of settings, which are still accepted.
RENAMED = {"history_bytes": "resume_bytes", "fence_history_bytes": "fence_event_bytes"}
NAME_CHARACTERS = re.compile(r"[A-Za-z0-9._/-]{0,200}")
EVERY_ADDRESS = "0.0.0.0", "::"  # noqa: S104  (to refuse them)


class Settings(BaseModel):
    """The settings of a server. `load` in setting_sources.py reads them."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    host: str = Field("127.0.0.1", description="Address to listen on.")
    port: int = Field(50051, ge=0, le=65535, description="Port to listen on; 0 for a free one.")
    data: Path = Field(Path("dynhull-data"), description="Folder of the data.")
    journal: str | None = Field(
        None,
        description=f"Address of a {names()} database for the data, in place of a folder: {examples()}.",
    )
    start_patience: float = Field(
        30.0,
        ge=0,
        description="Seconds at the start for which a database or a disk is tried that does not answer, or fails. One "
        "that is starting, full, locked or has too many connections is waited for as long as it takes.",
    )
    in_memory: bool = Field(False, description="Store nothing: all hulls are lost when the server stops.")
    durability: Durability = Field(
        Durability.SYNC,
        description="What an acknowledged batch survives. All: the end of the process, even a kill. sync: also a power "
        "failure. interval: a power failure a tenth of a second later. none: one after the operating system has "
        "written it, usually within half a minute.",
    )
    workers: int | None = Field(
        None,
        ge=1,
        le=1024,
        description="Number of processes that hold the hulls, each a part of them; without it, one process does "
        "everything, or one of each kind with --cluster. Limits apply to each process.",
    )
    gateways: int | None = Field(
        None, ge=1, le=256, description="Number of processes that take the calls for the workers; by default 1."
    )
    cluster: bool = Field(
        False,
        description="Share the hulls of the database of --journal with all other servers that do so, on any machines: "
        "workers come, go and replace each other, and each server takes all calls.",
    )
    partitions: int = Field(
        16,
        ge=1,
        le=1024,
        description="Number of parts of a new database of a cluster, which workers share. It cannot be changed later, "
        "except from one: see dynhull cluster split.",
    )
    cluster_host: str = Field(
        "127.0.0.1", description="Address of this machine at which the other servers of the cluster reach its workers."
    )
    max_clock_difference: float = Field(
        1.0,
        gt=0,
        description="Seconds by which the clock of this machine may differ from that of the database of the cluster.",
    )
    peer_ping_interval: float = Field(
        10.0,
        gt=0,
        description="Seconds between questions of a server of a cluster to another whether it is still there; without "
        "an answer for as long, it connects anew.",
    )
    cluster_ca: Path | None = Field(
        None,
        description="PEM file: servers of the cluster connect with TLS, to workers whose --tls-cert is signed by this "
        "certificate.",
    )
    threads: int | None = Field(
        None,
        ge=1,
        le=64,
        description="Number of threads that a process may use for one batch; by default the processors, divided by the "
        "workers, less one for the rest of the process, and at least one. That one then decides the fences of a large "
        "batch, too, if there is one thread for the batch.",
    )
    create_on_write: bool = Field(False, description="Create a missing hull with its first batch.")
    snapshot_points: int = Field(
        250_000,
        ge=1,
        description="Least number of points written to a hull between snapshots; also at least as many as it has.",
    )

    history_dir: str | None = Field(
        None,
        description="Folder for the past of hulls that keep theirs, or an object store, s3://BUCKET/PREFIX; by default "
        "`history` in the data folder. Servers of one database share it.",
    )
    max_history_age: float = Field(
        0.0,
        ge=0,
        le=1e9,
        description="Seconds for which the past of any hull is kept at most; 0 for as long as it says.",
    )
    max_history_bytes: int = Field(
        0, ge=0, description="Bytes that the past of all hulls takes at most; the oldest goes first. 0 for any number."
    )

    tls_cert: Path | None = Field(None, description="PEM file: the server's certificate and its chain up to the root.")
    tls_key: Path | None = Field(None, description="PEM file: the private key of the certificate.")
    tls_client_ca: Path | None = Field(
        None, description="PEM file: clients must present a certificate signed by this one."
    )
    tokens: Path | None = Field(
        None, description="TOML file of token hashes, see `dynhull token`; changes take effect at once."
    )
    insecure: bool = Field(False, description="Accept calls from other machines without TLS and tokens.")

    max_message_bytes: int = Field(64 * 2**20, ge=1024, le=2**30, description="Size of the largest message.")
    max_hulls: int = Field(100_000, ge=1, description="Largest number of hulls.")
    max_points: int = Field(100_000_000, ge=1, description="Largest number of points of a hull.")
    max_producers: int = Field(
        10_000,
        ge=1,
        description="Largest number of producers (writers that number their batches) of a hull within a day.",
    )
    max_producers_per_caller: int = Field(1_000, ge=1, description="The same per token, or without tokens per address.")
    max_streams: int = Field(10_000, ge=1, description="Largest number of simultaneous streaming calls.")
    max_streams_per_caller: int = Field(2_500, ge=1, description="The same per token, or without tokens per address.")
    max_many_watches_per_caller: int = Field(
        256,
        ge=1,
        description="Largest number of simultaneous watches of many hulls (WatchMany), per token, or without tokens "
        "per address.",
    )
    max_watched_hulls: int = Field(100_000, ge=1, description="Largest number of hulls of such a watch.")
    max_watched_bytes: int = Field(
        256 * 2**20, ge=1, description="Largest size of the states of all hulls of such a watch."
    )
    max_unread_bytes_per_caller: int = Field(
        256 * 2**20,
        ge=1,
        description="Largest size of what a caller of streams was sent and does not read, per token, or without tokens "
        "per address.",
    )
    max_health_calls: int = Field(1_000, ge=1, description="Largest number of simultaneous health checks and watches.")
    max_health_calls_per_caller: int = Field(32, ge=1, description="The same per address.")
    max_connections: int = Field(10_000, ge=1, description="Largest number of simultaneous connections.")
    max_connection_idle: float = Field(
        600.0, gt=0, description="Seconds until a connection without calls is closed; clients reconnect when needed."
    )
    min_ping_interval: float = Field(
        5.0, gt=0, description="Seconds that a client waits between two pings; one that floods pings is cut off."
    )
    max_watch_lag: float = Field(600.0, gt=0, description="Seconds that a watcher may take to receive one event.")
    resume_bytes: int = Field(
        4 * 2**20, ge=0, description="Memory per hull for earlier vertices, from which watches resume."
    )

    series_kept: float = Field(
        3600.0,
        ge=0,
        le=86400,
        description="Seconds for which the measures of hulls are kept in memory, every ten seconds in which a hull "
        "changes; 0 for none.",
    )
    series_bytes: int = Field(
        320 * 2**20, ge=0, description="Memory for these measures of all hulls; the oldest ones go when it is full."
    )

    max_past_reads: int = Field(16, ge=1, description="Largest number of simultaneous reads of the past of hulls.")
    max_past_reads_per_caller: int = Field(8, ge=1, description="The same per token, or without tokens per address.")
    max_past_rows: int = Field(
        20_000_000,
        ge=1,
        description="Largest number of points and of rows of batches that a read of the past may rebuild; and of those "
        "that are kept for the next ones.",
    )
    max_replays: int = Field(
        32, ge=1, description="Largest number of simultaneous replays; each has a hull of its own."
    )
    max_replays_per_caller: int = Field(16, ge=1, description="The same per token, or without tokens per address.")

    max_feeds: int = Field(1_000, ge=1, description="Largest number of simultaneous feeds of batches.")
    max_feeds_per_caller: int = Field(100, ge=1, description="The same per token, or without tokens per address.")
    max_feed_consumers: int = Field(1_000, ge=1, description="Largest number of durable consumers of feeds.")

    max_fences: int = Field(100_000, ge=1, description="Largest number of fences.")
    max_alarms: int = Field(100_000, ge=1, description="Largest number of alarms.")
    max_alarm_hulls: int = Field(
        1_000_000,
        ge=1,
        description="Largest number of hulls that alarms watch, each counted once for each alarm. Beyond it "
        "alarms, and new hulls with their prefixes, are refused.",
    )
    max_fence_corners: int = Field(100_000, ge=3, description="Largest number of corners of the area of a fence.")
    max_fence_consumers: int = Field(
        1_000, ge=1, description="Largest number of durable consumers of a fence or alarm."
    )
    max_fence_events: int = Field(
        1_000_000, ge=1, description="Number of events of a fence to keep, at most; older ones are dropped."
    )
    max_fence_event_age: float = Field(
        0.0, ge=0, description="Seconds after which events of fences are dropped; 0 to keep them."
    )
    fence_event_bytes: int = Field(
        2**18, ge=0, description="Memory for recent events, times the number of fences; 64 MB at most."
    )

    scrub_cpu: float = Field(
        0.05,
        ge=0,
        le=1,
        description="Share of a processor for the scrub, which recomputes hulls and fences; 0 for none.",
    )
    scrub_pause: float = Field(60.0, gt=0, description="Seconds between rounds of the scrub.")

    metrics_host: str = Field(
        "127.0.0.1",
        description="Address of the metrics page. Callers on other machines need a token that may read every hull.",
    )
    metrics_port: int | None = Field(
        None, ge=0, le=65535, description="Port of the metrics page for Prometheus; without it, no metrics."
    )
    metrics_prefix: tuple[str, ...] = Field(
        (),
        description="Hulls whose names begin with this have their measures on the metrics page: area, perimeter, "
        "diameter, width, points, vertices, the time of the last change and the number of revisions. Can be given "
        "several times; in the environment separated by commas.",
    )
    metrics_hulls: int = Field(
        1_000, ge=0, description="Largest number of hulls with their measures on the metrics page: the oldest."
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field("info", description="Least level to log.")
    log_format: Literal["text", "json"] = Field("text", description="Format of the log.")
    grace: float = Field(30.0, ge=0, description="Seconds that calls in progress get to finish at shutdown.")

    @field_validator("metrics_prefix", mode="before")
    @classmethod
    def _separated(cls, value: object) -> object:
        return [each.strip() for each in value.split(",")] if isinstance(value, str) else value

    @field_validator("metrics_prefix")
    @classmethod
    def _of_names(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for prefix in value:
            if not NAME_CHARACTERS.fullmatch(prefix):
                raise ValueError(f'no name begins with {prefix!r}: names consist of letters, digits and "._-/"')
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if is_database(self.data):
            raise ValueError("--data is a folder: give the address of a database as --journal")
        if self.journal is not None:
            _require_known(self.journal)
        if (self.tls_cert is None) != (self.tls_key is None):
            raise ValueError("--tls-cert and --tls-key must be given together")
        if self.tls_client_ca and not self.tls_cert:
            raise ValueError("--tls-client-ca needs --tls-cert and --tls-key")
        if self.gateways is not None and self.workers is None and not self.cluster:
            raise ValueError("--gateways needs --workers or --cluster")
        if self.cluster and self.journal is None:
            raise ValueError("--cluster needs --journal: the servers share a database")
        in_database = self.journal is not None and (self.cluster or self.workers is not None)
        if in_database and self.peer_ping_interval < self.min_ping_interval:
            raise ValueError("--peer-ping-interval must not be less than --min-ping-interval")
        if self.cluster_ca and not self.tls_cert:
            raise ValueError("--cluster-ca needs --tls-cert and --tls-key")
        if self.cluster_host.strip("[]") in EVERY_ADDRESS:
            raise ValueError(f"--cluster-host {self.cluster_host} is no address for others: give one of this machine")
        if self.cluster and not is_loopback(self.cluster_host) and self.cluster_ca is None and not self.insecure:
            raise ValueError(
                f"--cluster-host {self.cluster_host} can be reached by other machines: give --cluster-ca, or "
                "--insecure to connect servers without TLS"
            )
        if self.history_dir is not None and self.in_memory:
            raise ValueError("--history-dir keeps what --in-memory does not store: give one of them")
        if self.history_dir is not None and find_spec("pyarrow") is None:
            raise ValueError("--history-dir needs pyarrow: pip install 'dynhull[history]'")
        if self.history_dir is not None and is_store(self.history_dir):
            try:
                require_store(self.history_dir)
            except ValueError as error:  # which does not repeat what may be secret
                raise ValueError(f"--history-dir {error}") from None
        protected = self.tls_cert and self.tokens
        for host in (self.host, *([] if self.metrics_port is None else [self.metrics_host])):
            if not is_loopback(host) and not protected and not self.insecure:
                raise ValueError(
                    f"{host} can be reached by other machines: give --tls-cert, --tls-key and --tokens, or "
                    "--insecure to serve without them"
                )
        return self


def _require_known(journal: str) -> None:
    try:
        kind_of(journal)
    except ValueError as error:
        raise ValueError(f"--journal: {error}") from None


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach the address."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"
