"""What the options of commands say about a receiver."""

from collections.abc import Sequence
from pathlib import Path

from dynhull_cli.durations import more_than_0

from .bodies.body import CLOUD_EVENTS, Body, Header
from .signatures import read_secret
from .sources import Kind
from .targets import TargetOptions


def options_from(
    kinds: Sequence[Kind],
    *,
    secret: list[str] | None,
    unsigned: bool,
    batch: int,
    timeout: str,
    allow_private: bool,
    body_template: Path | None,
    content_type: str | None,
    header: list[str] | None,
    consumer: str | None,
    kafka_config: Path | None,
) -> TargetOptions:
    """The options of a receiver of events of these kinds.

    Raises:
        ValueError: one of them is wrong: the message names it, and of a template the line. OSError: there is no such
            file.
    """
    body: Body = CLOUD_EVENTS
    headers: Sequence[Header] = ()
    if content_type is not None and body_template is None:
        raise ValueError("--content-type is that of what --body-template makes: give both")
    if body_template is not None:
        from .bodies.template import JSON_TYPE, read_template

        body = read_template(body_template, content_type or JSON_TYPE, kinds)
    if header:
        from .bodies.headers import read_headers

        headers = read_headers(header, kinds)
    return TargetOptions(
        keys=[read_secret(each) for each in secret or ()],
        unsigned=unsigned,
        batch=batch,
        timeout=more_than_0(timeout, "--timeout"),
        allow_private=allow_private,
        body=body,
        headers=headers,
        consumer=consumer,
        kafka_config=kafka_config,
    )
