"""`dynhull fences`: all its commands."""

from ..groups import group
from .between import between
from .following import ack, watch
from .reading import delete, inside, list_fences, show
from .settings import create, replace


@group(
    create=create,
    list=list_fences,
    show=show,
    inside=inside,
    watch=watch,
    ack=ack,
    between=between,
    replace=replace,
    delete=delete,
)
def fences() -> None:
    """Create fences, and follow who enters and leaves them.

    A fence compares subjects, the keys of a hull, with an area: another hull, polygons or a disk. It makes an event
    when one enters or leaves, whichever side moves. Events are numbered, and kept for durable consumers.
    """
