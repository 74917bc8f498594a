"""How to serve: each setting once, for flags, environment, file and help."""

import ipaddress
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, ValidationError, model_validator
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict, TomlConfigSettingsSource

from .storage.durability import Durability

PREFIX = "DYNHULL_"


class Settings(BaseSettings):
    """The settings of a server."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, extra="forbid", frozen=True)

    host: str = Field("127.0.0.1", description="Address to listen on.")
    port: int = Field(50051, ge=0, le=65535, description="Port to listen on; 0 for a free one.")
    data: Path = Field(Path("dynhull-data"), description="Folder where everything is kept.")
    in_memory: bool = Field(False, description="Keep nothing: hulls are gone when the server stops.")
    durability: Durability = Field(
        Durability.SYNC,
        description="What an acknowledgement promises. sync: the batch survives a power failure. interval: a power "
        "failure after a tenth of a second. none: one that the operating system has had time for. All survive the end "
        "of the process, however sudden.",
    )
    create_on_write: bool = Field(False, description="Create a hull when the first batch for it comes.")
    snapshot_points: int = Field(
        250_000, ge=1, description="A hull gets a snapshot when it took so many points, and as many as it has."
    )

    tls_cert: Path | None = Field(None, description="PEM file: the server's certificate and those up to the root.")
    tls_key: Path | None = Field(None, description="PEM file: the certificate's private key.")
    tls_client_ca: Path | None = Field(None, description="PEM file: clients must show a certificate signed by it.")
    tokens: Path | None = Field(None, description="TOML file of token hashes, see `dynhull token`; read when changed.")
    insecure: bool = Field(False, description="Listen to other machines without TLS and tokens.")

    max_message_bytes: int = Field(64 * 2**20, ge=1024, le=2**30, description="Largest message.")
    max_hulls: int = Field(100_000, ge=1, description="How many hulls there may be.")
    max_points: int = Field(100_000_000, ge=1, description="How many points a hull may have.")
    max_producers: int = Field(10_000, ge=1, description="How many numbering writers a hull may have in a day.")
    max_producers_per_caller: int = Field(
        1_000, ge=1, description="How many of those one token may name, or without tokens one address."
    )
    max_streams: int = Field(10_000, ge=1, description="How many streaming calls there may be at a time.")
    max_streams_per_caller: int = Field(
        2_500, ge=1, description="How many of those one token may have, or without tokens one address."
    )
    max_health_calls: int = Field(1_000, ge=1, description="How many health checks and watches there may be at a time.")
    max_health_calls_per_caller: int = Field(32, ge=1, description="How many of those one address may have.")
    max_connections: int = Field(10_000, ge=1, description="How many connections there may be at a time.")
    max_connection_idle: float = Field(
        600.0, gt=0, description="Seconds that a connection without calls is kept; clients make a new one when needed."
    )
    max_watch_lag: float = Field(600.0, gt=0, description="Seconds a watcher may take for one event.")
    history_bytes: int = Field(4 * 2**20, ge=0, description="Memory a hull may take for watches that resume.")

    scrub_cpu: float = Field(
        0.05, ge=0, le=1, description="Share of a processor for comparing hulls with Chan's algorithm; 0 for none."
    )
    scrub_pause: float = Field(60.0, gt=0, description="Seconds between two rounds of that.")

    metrics_host: str = Field(
        "127.0.0.1",
        description="Address for Prometheus. On another machine it must show a token that may read every hull.",
    )
    metrics_port: int | None = Field(None, ge=0, le=65535, description="Port for Prometheus; without it, no metrics.")
    log_level: Literal["debug", "info", "warning", "error"] = Field("info", description="What to log.")
    log_format: Literal["text", "json"] = Field("text", description="How to log.")
    grace: float = Field(30.0, ge=0, description="Seconds that calls under way get at the end.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.tls_cert is None) != (self.tls_key is None):
            raise ValueError("--tls-cert and --tls-key go together")
        if self.tls_client_ca and not self.tls_cert:
            raise ValueError("--tls-client-ca needs --tls-cert and --tls-key")
        protected = self.tls_cert and self.tokens
        for host in (self.host, *([] if self.metrics_port is None else [self.metrics_host])):
            if not is_loopback(host) and not protected and not self.insecure:
                raise ValueError(
                    f"{host} can be reached by other machines: give --tls-cert, --tls-key and --tokens, or say "
                    "--insecure to do without"
                )
        return self

    @classmethod
    def settings_customise_sources(
        cls, settings_cls: type[BaseSettings], *sources: PydanticBaseSettingsSource, **more: PydanticBaseSettingsSource
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Flags before environment before file."""
        named = dict(zip(("init_settings", "env_settings"), sources, strict=False)) | more
        return named["init_settings"], named["env_settings"], TomlConfigSettingsSource(settings_cls)


class SettingsError(Exception):
    """The settings cannot be used; the message says which and why, a line each."""


def load(flags: Mapping[str, Any], file: Path | None) -> Settings:
    """The settings from flags, environment and file, or raise SettingsError."""
    read_file(file)

    class FromFile(Settings):
        model_config = SettingsConfigDict(toml_file=file)

    try:
        return FromFile(**flags)
    except ValidationError as error:
        lines = []
        for each in error.errors():
            where = ".".join(map(str, each["loc"]))
            lines.append(f"{where}: {each['msg']}" if where else str(each["ctx"]["error"]))
        raise SettingsError("\n".join(lines)) from None


def origins(flags: Mapping[str, Any], file: Path | None) -> dict[str, str]:
    """Where each setting comes from."""
    in_file = read_file(file)
    variables = {name.upper() for name in os.environ}
    origins = {}
    for name in Settings.model_fields:
        variable = f"{PREFIX}{name.upper()}"
        if name in flags:
            origins[name] = "flag"
        elif variable in variables:
            origins[name] = variable
        else:
            origins[name] = str(file) if name in in_file else "default"
    return origins


def read_file(file: Path | None) -> dict[str, Any]:
    """What a settings file holds, or raise SettingsError."""
    if file is None:
        return {}
    try:
        return tomllib.loads(file.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise SettingsError(f"{file}: {error}") from None


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach the address."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"
