"""What is committed."""

from .feed_consumers import DropFeedConsumer, PutFeedConsumer
from .fences.events.block import AppendEvents
from .fences.model.records import AddFence, ChangeFence, DropConsumer, DropEvents, DropFence, PutConsumer, PutDelays
from .records import Append, Create, Delete

HullChange = Create | Append | Delete
FenceChange = AddFence | ChangeFence | DropFence | AppendEvents | PutDelays | DropEvents | PutConsumer | DropConsumer
FeedChange = PutFeedConsumer | DropFeedConsumer
Change = HullChange | FenceChange | FeedChange
