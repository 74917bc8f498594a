"""What is committed."""

from .fences.model.records import (
    AddFence,
    AppendEvents,
    ChangeFence,
    DropConsumer,
    DropEvents,
    DropFence,
    PutConsumer,
    PutDelays,
)
from .records import Append, Create, Delete

HullChange = Create | Append | Delete
FenceChange = AddFence | ChangeFence | DropFence | AppendEvents | PutDelays | DropEvents | PutConsumer | DropConsumer
Change = HullChange | FenceChange
