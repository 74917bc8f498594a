"""`dynhull alarms`: all its commands."""

from ..groups import group
from .following import watch
from .reading import delete, list_alarms, show
from .settings import ack, create, mute


@group(create=create, list=list_alarms, show=show, watch=watch, ack=ack, mute=mute, delete=delete)
def alarms() -> None:
    """Create alarms on the outline of hulls, and follow when they are raised and cleared.

    An alarm compares a measure of a hull with a bound, or says that a hull has fallen silent, comes near another one,
    or has a vertex in an area: one hull, or all with a prefix. Its events are numbered, and kept for durable consumers.
    """
