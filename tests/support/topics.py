"""Topics of a real Kafka."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from aiokafka.admin import AIOKafkaAdminClient, NewTopic
from aiokafka.errors import UnknownTopicOrPartitionError
from patience import PATIENCE, wait_until

from dynhull_bridges.ingest.topic_id import topic_id


def administer(servers: str, do: Callable[[AIOKafkaAdminClient], Awaitable[Any]]) -> None:
    async def run() -> None:
        admin = AIOKafkaAdminClient(bootstrap_servers=servers)
        await admin.start()
        try:
            await do(admin)
        finally:
            await admin.close()

    asyncio.run(run())


def made(servers: str, topic: str, partitions: int = 1, **settings: object) -> None:
    """Make a topic, in place of one under its name."""
    configs = {name.replace("__", "."): str(value) for name, value in settings.items()}
    before = known_id(servers, topic)
    if before is not None:
        administer(servers, lambda admin: admin.delete_topics([topic]))
    administer(servers, lambda admin: admin.create_topics([NewTopic(topic, partitions, 1, topic_configs=configs)]))
    wait_until(lambda: known_id(servers, topic) not in (None, before))


def known_id(servers: str, topic: str) -> bytes | None:
    reached = {"bootstrap_servers": servers, "request_timeout_ms": 1000 * PATIENCE}
    try:
        return asyncio.run(topic_id(topic, reached))
    except UnknownTopicOrPartitionError:
        return None
