"""Follows the fences of a scene, and compares each event with a recomputation from scratch."""

from collections import deque

from dynhull_client import Batch, Circle, FenceEvent, HullClient

from .fences import Circled, Happening, Rivals, members
from .follower import Follower
from .scene import Frame, Scene


class Alarms:
    """The fences of a scene: created, followed by a thread each, and compared after each frame.

    Attributes:
        agreed: the number of events that were equal to the recomputed ones, in order.
        expected: the number of events that were recomputed.
    """

    def __init__(self, client: HullClient, scene: Scene) -> None:
        assert scene.circles or scene.rivals
        self.agreed = self.expected = 0
        self._client = client
        self._hull = scene.hull_name
        self._groups = scene.rivals or ()
        self._before: dict[str, set[str]] = {group: set() for group in self._groups}
        self._oracles: dict[str, Circled | Rivals] = {}
        for name, (x, y, radius) in scene.circles.items():
            circle = Circle(x, y, radius)
            client.create_fence(name, circle, self._hull, initial="none")
            self._oracles[name] = Circled(circle, scene.center)
        if scene.rivals:
            first, second = (self.hull_of(group) for group in scene.rivals)
            for hull in (first, second):
                client.create_hull(hull, keyed="str", geographic=scene.center is not None, center=scene.center)
            name = " and ".join(scene.rivals).replace(" ", "-")
            client.create_fence(name, first, other_hull=second, initial="none")
            self._oracles[name] = Rivals(scene.rivals, scene.center)
        self._alarms = {name: Alarm(client, name) for name in self._oracles}

    def hull_of(self, group: str) -> str:
        """The name of the hull of a group."""
        return f"{self._hull}/{group}"

    def batches(self, frame: Frame) -> dict[str, Batch]:
        """What a frame changes in the hulls of the groups."""
        batches = {}
        for group in self._groups:
            now = members(frame, group)
            gone = sorted(self._before[group] - now.keys())
            batches[self.hull_of(group)] = Batch(keys=list(now), points=list(now.values()), remove=gone)
            self._before[group] = set(now)
        return batches

    def check(self, frame: Frame, revision: int) -> tuple[list[FenceEvent], str | None]:
        """The events of a frame, and the first difference to the recomputed ones; None if there is none."""
        seen: list[FenceEvent] = []
        for name, oracle in self._oracles.items():
            expected = oracle.expected(frame)
            self.expected += len(expected)
            for event in expected:
                found = self._alarms[name].next()
                if found is None:
                    return seen, f"{name}: the event {event} is missing"
                seen.append(found)
                if _happening(found) != event or (found.key is not None and found.revision != revision):
                    return seen, f"{name}: the event is {found}, not {event} at revision {revision}"
                self.agreed += 1
        return seen, None

    def surplus(self) -> str | None:
        """An event that nobody expected; None if there is none."""
        for name in self._oracles:
            last, taken = self._client.get_fence(name).last_sequence, self._alarms[name].taken
            if last != taken:
                return f"{name}: the fence has {last} events, {taken} were expected"
        return None

    def stop(self) -> None:
        """End the subscriptions."""
        for alarm in self._alarms.values():
            alarm.stop()


class Alarm:
    """The events of one fence.

    Attributes:
        taken: the number of events taken by `next`.
    """

    def __init__(self, client: HullClient, name: str) -> None:
        self.taken = 0
        self._events: deque[FenceEvent] = deque()
        self._follower = Follower(f"fence {name}", client.watch_fence(name, after=0), self._events.append)

    def next(self) -> FenceEvent | None:
        """The next event; None if it does not come in time."""
        event = self._follower.wait(lambda: self._events.popleft() if self._events else None)
        self.taken += event is not None
        return event

    def stop(self) -> None:
        """End the subscription."""
        self._follower.stop()


def _happening(event: FenceEvent) -> Happening:
    key = None if event.key is None else str(event.key)
    cause = frozenset() if key is None else frozenset(event.cause)
    return Happening(event.type, key, cause, event.position, event.previous_position)
