"""What is committed."""

from .fences.records import (
    AddFence,
    AppendEvents,
    ChangeFence,
    DropConsumer,
    DropEvents,
    DropFence,
    PutConsumer,
)
from .records import Append, Create, Delete

HullChange = Create | Append | Delete
FenceChange = AddFence | ChangeFence | DropFence | AppendEvents | DropEvents | PutConsumer | DropConsumer
Change = HullChange | FenceChange
