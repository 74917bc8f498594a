"""Durable consumers of feeds: list, acknowledge, delete."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, status
from pydantic import BeforeValidator, Field, StrictStr

import dynhull_client as sdk

from .answers import answering
from .bodies import JsonRoute
from .callers import Caller
from .pages import page
from .schemas import ConsumerPath, Count, HullPath, Limit, Prefix, Request, Response, example

router = APIRouter(tags=["feeds"], route_class=JsonRoute)
PAST = r"^[A-Za-z0-9._/-]{0,200}:[01]:[A-Za-z0-9._/-]{1,200}$"
FeedPrefix = Annotated[str, Query(max_length=200, description="The prefix of the feed.")]


class RevisionDone(Request):
    """The last revision that was processed."""

    model_config = example(revision=1)

    revision: Count
    uid: StrictStr = Field("", max_length=200, description="The uid of the hull, to notice that it was replaced.")


class PositionDone(Request):
    """The last position that was processed."""

    model_config = example(position="")

    position: StrictStr = Field(
        max_length=40_960, description="The id of the last event that was processed; empty for the beginning."
    )


def _written(after: Any) -> Any:
    return after.hex() if isinstance(after, bytes) else after


@answering(sdk.FeedConsumer)
class FeedConsumer(Response):
    """A durable reader of a feed."""

    after: Annotated[int | str, BeforeValidator(_written)] = Field(
        description="What it has acknowledged: a revision, or of a prefix the id of an event; empty for the beginning."
    )


class FeedConsumerPage(Response):
    """Some of the consumers."""

    consumers: list[FeedConsumer]
    next: str | None = Field(description="What to give as `after` for the next page; null on the last one.")


@router.get("/feed/consumers")
async def list_feed_consumers(
    client: Caller,
    prefix: Prefix = "",
    after: Annotated[str | None, Query(pattern=PAST, description="The `next` of the page before.")] = None,
    limit: Limit = 100,
) -> FeedConsumerPage:
    """List the consumers of feeds by what they read, in pages. A caller with a token gets those of what it may read."""
    before = _order(after) if after is not None else None
    found, more = await page(
        client.list_feed_consumers(prefix), limit, lambda each: before is not None and _order(_token(each)) <= before
    )
    shown = [FeedConsumer.model_validate(each) for each in found]
    return FeedConsumerPage(consumers=shown, next=_token(found[-1]) if more else None)


@router.put("/hulls/{name}/feed/consumers/{consumer}")
async def ack_hull_feed(
    client: Caller, name: HullPath, consumer: ConsumerPath, processed: RevisionDone
) -> FeedConsumer:
    """Acknowledge the batches of a hull up to a revision. A new consumer is created."""
    acknowledged = await client.ack_feed(name, consumer=consumer, after=processed.revision, uid=processed.uid)
    return FeedConsumer.model_validate(acknowledged)


@router.delete("/hulls/{name}/feed/consumers/{consumer}", status_code=status.HTTP_204_NO_CONTENT)
async def delete_hull_feed_consumer(client: Caller, name: HullPath, consumer: ConsumerPath) -> None:
    """Delete a durable consumer of the feed of a hull, also of one that is not there any more."""
    await client.delete_feed_consumer(name, consumer=consumer)


@router.put("/feed/consumers/{consumer}")
async def ack_feed(
    client: Caller, consumer: ConsumerPath, processed: PositionDone, prefix: FeedPrefix = ""
) -> FeedConsumer:
    """Acknowledge the batches of the hulls of a prefix up to a position. A new consumer is created."""
    try:
        position = bytes.fromhex(processed.position)
    except ValueError:
        raise ValueError(f"position: must be the id of an event, not {processed.position!r}") from None
    return FeedConsumer.model_validate(await client.ack_feed(prefix=prefix, consumer=consumer, after=position or 0))


@router.delete("/feed/consumers/{consumer}", status_code=status.HTTP_204_NO_CONTENT)
async def delete_feed_consumer(client: Caller, consumer: ConsumerPath, prefix: FeedPrefix = "") -> None:
    """Delete a durable consumer of the feed of a prefix."""
    await client.delete_feed_consumer(prefix=prefix, consumer=consumer)


def _token(consumer: sdk.FeedConsumer) -> str:
    of = consumer.hull if consumer.prefix is None else consumer.prefix
    return f"{of}:{int(consumer.prefix is not None)}:{consumer.name}"


def _order(token: str) -> tuple[str, ...]:
    return tuple(token.split(":"))
