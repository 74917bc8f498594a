"""Fences by accuracy: a subject enters or leaves once it is on the other side by more than the error of its position.

The judge decides in fractions; places and errors lie on a grid on which distances are often met to the last bit.
"""

import asyncio
import random
from contextlib import asynccontextmanager
from fractions import Fraction

import numpy as np
import pytest
from live_engine import LIMITS
from mortal_server import MortalServer
from patience import PATIENCE
from server_process import server_process
from support.sides import shape_of_hull

from dynhull.keys import PackedKeys, key_list
from dynhull_client import AsyncHullClient, Batch, Circle, HullClient, InvalidRequestError, Quarantine
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig, HullArea, PolygonArea
from dynhull_server.state.fences.model.records import EventType
from dynhull_server.state.records import HullSettings
from dynhull_server.storage.memory import MemoryStorage
from dynhull_server.storage.sqlite.storage import SQLiteStorage

HULLS = "fleet/a", "fleet/b"
KEYS = [f"k{number}" for number in range(9)]
CORNERS = {"sw": (0, 0), "se": (12, 0), "ne": (12, 9), "nw": (0, 9)}
MOVED = {"sw": (0, 0), "se": (12, 0), "ne": (16, 12), "nw": (0, 9)}
RING = np.array([*CORNERS.values()], "<f8").tobytes()
AREAS = {
    "polygon": PolygonArea(((RING,),)),
    "circle": CircleArea(4.0, 3.0, 5.0),
    "hull": HullArea("zone"),
}


@asynccontextmanager
async def served(storage=None):
    machine = Machine()
    supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
    engine = Engine(LIMITS, storage or MemoryStorage(), supervisor, machine)
    await engine.start(lambda *_: None)
    for name in (*HULLS, "zone"):
        await engine.hulls.create(name, HullSettings("str"))
    yield engine
    await supervisor.stop()
    await engine.close()


def batch(positions, removes=(), accuracies=None):
    points = np.array(list(positions.values()), float).reshape(-1, 2)
    found = None if accuracies is None else np.array(accuracies, float)
    return KeyedBatch("str", PackedKeys.pack(list(positions)), points, PackedKeys.pack(removes), accuracies=found)


async def apply(engine, name, *arguments):
    await engine.hulls.apply(Write(name, batch(*arguments), engine.driver.time()), create=False)


def squared(p, a, b):
    """The squared distance of a point and a segment."""
    (px, py), (ax, ay), (bx, by) = (tuple(map(Fraction, each)) for each in (p, a, b))
    ux, uy = bx - ax, by - ay
    share = min(max(((px - ax) * ux + (py - ay) * uy) / (ux * ux + uy * uy), 0), 1)
    return (px - ax - share * ux) ** 2 + (py - ay - share * uy) ** 2


class Judge:
    """Who is inside, and the events of a fence around a convex ring or a circle."""

    def __init__(self, area, margin):
        self.area, self.margin = area, Fraction(margin)
        self.ring = list(CORNERS.values())
        self.reported, self.exact = {}, {}
        self.events = []

    def side(self, p, *, was):
        """The exact side, and the squared distance to what it would have to pass."""
        if isinstance(self.area, CircleArea):
            x, y = Fraction(p[0]) - Fraction(self.area.x), Fraction(p[1]) - Fraction(self.area.y)
            square, radius = x * x + y * y, Fraction(self.area.radius)
            return square <= (radius + (self.margin if was else 0)) ** 2
        return self.within(p) or (was and self.margin > 0 and self.near(p) <= self.margin**2)

    def within(self, p):
        turns = [
            (bx - ax) * (Fraction(p[1]) - ay) - (by - ay) * (Fraction(p[0]) - ax)
            for (ax, ay), (bx, by) in zip(self.ring, [*self.ring[1:], self.ring[0]], strict=True)
        ]
        return all(turn >= 0 for turn in turns)

    def near(self, p):
        return min(squared(p, a, b) for a, b in zip(self.ring, [*self.ring[1:], self.ring[0]], strict=True))

    def clear(self, p, error):
        if not error:
            return True
        if isinstance(self.area, CircleArea):
            x, y = Fraction(p[0]) - Fraction(self.area.x), Fraction(p[1]) - Fraction(self.area.y)
            square, radius = x * x + y * y, Fraction(self.area.radius)
            if square <= radius**2:
                return error < radius and square < (radius - error) ** 2
            return square > (radius + self.margin + error) ** 2
        return self.near(p) > (error if self.within(p) else self.margin + error) ** 2

    def look(self, held):
        """The events after a revision; `held` has the place and the error of each key."""
        for key in sorted({*self.reported, *held}):
            was = self.reported.get(key, False)
            if key not in held:
                self.exact.pop(key, None)
                self.reported.pop(key, None)
                if was:
                    self.events.append(("EXIT", key))
                continue
            p, error = held[key]
            self.exact[key] = side = self.side(p, was=self.exact.get(key, False))
            now = side if self.clear(p, Fraction(error)) else was
            self.reported[key] = now
            if now != was:
                self.events.append(("ENTER" if now else "EXIT", key))


@pytest.mark.every(5)
@pytest.mark.parametrize("kind", AREAS)
@pytest.mark.parametrize(("margin", "seed"), [(0.0, 1), (0.0, 2), (0.5, 3), (1.0, 4)])
def test_events_are_those_of_the_judge(kind, margin, seed):
    """Subjects of two hulls move, come, go and change hulls, with errors and without, while the area moves."""

    async def life():
        rng, judge, held = random.Random(seed), Judge(AREAS[kind], margin), {}
        async with served() as engine:
            await apply(engine, "zone", CORNERS)
            config = FenceConfig(AREAS[kind], "prefix", "fleet/", margin=margin, by_accuracy=True, initial="none")
            await engine.fences.create("fence", config)
            for step in range(200):
                keys = rng.sample(KEYS, rng.randint(1, 4))
                hull = rng.choice(HULLS)
                match rng.choice(["put", "put", "put", "put", "remove", "transfer", "zone", "again"]):
                    case "remove":
                        await apply(engine, hull, {}, keys)
                        for key in keys:
                            if held.get(key, ("",))[0] == hull:
                                del held[key]
                    case "zone" if kind == "hull":
                        judge.ring = list((MOVED if step % 2 else CORNERS).values())
                        await apply(engine, "zone", MOVED if step % 2 else CORNERS)
                    case "transfer":
                        other = HULLS[1 - HULLS.index(hull)]
                        put = {key: held[key][1] for key in keys if held.get(key, ("",))[0] == hull}
                        errors = [rng.choice([0, 1, 2]) for _ in put]
                        if put:
                            writes = [
                                Write(hull, batch({}, list(put)), engine.driver.time()),
                                Write(other, batch(put, (), errors), engine.driver.time()),
                            ]
                            await engine.hulls.apply_together(writes, 0)
                            held |= {key: (other, put[key], e) for key, e in zip(put, errors, strict=True)}
                    case move:
                        mine = [key for key in keys if held.get(key, (hull,))[0] == hull]
                        places = {key: (rng.randint(-6, 40) / 2, rng.randint(-6, 30) / 2) for key in mine}
                        if move == "again":  # the same place, with another error
                            places = {key: held[key][1] for key in mine if key in held}
                        errors = [rng.choice([0.0, 0.5, 1.0, 2.5, 30.0]) for _ in places]
                        if rng.random() < 0.2:
                            errors = [0.0] * len(places)
                        await apply(engine, hull, places, (), errors if any(errors) else None)
                        held |= {key: (hull, places[key], e) for key, e in zip(places, errors, strict=True)}
                judge.look({key: each[1:] for key, each in held.items()})
            live = engine.fences.get("fence")
            found = await live.events(0, 10_000)
            inside = {key for each in (await live.inside()).members for key in key_list(each.keys)}
            assert inside == {key for key, now in judge.reported.items() if now}
            return found, judge.events

    found, expected = asyncio.run(life())
    assert [(e.type.name, e.key) for e in found if e.type is not EventType.TRANSFER] == expected
    assert len(expected) > 20


class JudgeOfOthers:
    """Who is inside of the hull of the others, by whole numbers of halves, and the events of that."""

    def __init__(self, margin):
        self.margin, self.exact, self.reported, self.events = int(2 * margin), {}, {}, []

    def look(self, held):
        places = {key: (int(2 * x), int(2 * y)) for key, ((x, y), _) in held.items()}
        for key in sorted({*self.reported, *held}):
            was = self.reported.pop(key, False)
            if key not in held:
                self.exact.pop(key, None)
                self.events += [("EXIT", key, None)] * was
                continue
            p, error = places[key], int(2 * held[key][1])
            others = shape_of_hull(place for other, place in places.items() if other != key)
            held_by = others.holds(p, closed=True)
            stays = self.exact.get(key, False) and not others.farther(p, self.margin, closed=True)
            self.exact[key] = side = held_by or stays
            far = (
                others.clear(p, error, closed=True) if held_by else others.farther(p, self.margin + error, closed=True)
            )
            self.reported[key] = now = side if not error or far else was
            if now != was:
                self.events.append(("ENTER" if now else "EXIT", key, others.distance(p, closed=True)))


@pytest.mark.parametrize(("margin", "seed"), [(0.5, 1), (2.0, 2), (5.0, 3)])
def test_who_leaves_the_pack_by_more_than_the_error(margin, seed):
    """Also where only those who were inside have moved, and the outline of all stays as it was."""

    async def life():
        rng, judge, held = random.Random(seed), JudgeOfOthers(margin), {}
        async with served() as engine:
            area = HullArea("fleet/a", without_self=True)
            config = FenceConfig(area, "hull", "fleet/a", margin=margin, by_accuracy=True, initial="none")
            await engine.fences.create("pack", config)
            for _ in range(300):
                keys = rng.sample(KEYS, rng.randint(1, 3))
                if rng.random() < 0.1:
                    await apply(engine, "fleet/a", {}, keys)
                    held = {key: each for key, each in held.items() if key not in keys}
                else:
                    places = {key: (rng.randint(0, 24) / 2, rng.randint(0, 12) / 2) for key in keys}
                    errors = [rng.choice([0.0, 0.5, 1.0, 2.5, 30.0]) for _ in places]
                    await apply(engine, "fleet/a", places, (), errors if any(errors) else None)
                    held |= {key: (places[key], e) for key, e in zip(places, errors, strict=True)}
                judge.look(held)
            live = engine.fences.get("pack")
            inside = {key for each in (await live.inside()).members for key in key_list(each.keys)}
            assert inside == {key for key, now in judge.reported.items() if now}
            return await live.events(0, 10_000), judge.events

    found, expected = asyncio.run(life())
    assert [(e.type.name, e.key, e.distance) for e in found] == expected
    assert len(expected) > 30


def test_an_event_is_never_before_what_it_confirms(tmp_path):
    """Two reports that are committed together, of which the second had arrived earlier."""

    async def life():
        async with served(SQLiteStorage(tmp_path)) as engine:
            config = FenceConfig(CircleArea(0, 0, 5), "hull", "fleet/a", confirmations=2, initial="none")
            await engine.fences.create("fence", config)
            await apply(engine, "fleet/a", {"k": (9, 9)})
            now, other = engine.driver.time(), batch({"other": (9, 9)})
            writes = [Write("fleet/a", other, now)]  # while it is stored, the others wait
            writes += [Write("fleet/a", batch({"k": (1, x)}), now + later) for x, later in ((1, 10**6), (2, 0))]
            await asyncio.gather(*(engine.hulls.apply(each, create=False) for each in writes))
            return await engine.fences.get("fence").events(0, 10)

    (event,) = asyncio.run(life())
    assert (event.type, event.position, event.subject_revision) == (EventType.ENTER, (1, 2), 4)
    assert event.time == event.first_time


# From outside


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with server_process("--data", str(tmp_path_factory.mktemp("accuracy") / "data")) as process:
        yield process.address


@pytest.fixture(scope="module")
def client(address):
    with HullClient(address) as client:
        yield client


def told(client, fence, after=0):
    last = client.get_fence(fence).last_sequence
    found = []
    with client.watch_fence(fence, after=after, timeout=PATIENCE) as watch:
        while after + len(found) < last:
            found.append(next(watch))
    return [(event.type, event.key, *sorted(event.cause)) for event in found]


def test_what_a_fence_says_of_doubtful_positions(client):
    client.create_hull("words", keyed="str")
    client.put("words", ["sure", "unsure"], [[1, 0], [4.5, 0]], accuracies=[2, 2])
    client.create_fence("words", Circle(0, 0, 5), "words", by_accuracy=True)
    fence = client.get_fence("words")
    assert (fence.by_accuracy, fence.inside) == (True, 1)
    client.put("words", ["unsure"], [[4.5, 0]], accuracies=[0.5])  # met to the last bit, and not more
    client.put("words", ["unsure", "new"], [[4.5, 0], [3, 0]], accuracies=[0.25, 3])
    client.put("words", ["sure"], [[5.5, 0]], accuracies=[1])  # perhaps it has left
    client.put("words", ["sure"], [[2, 0]], accuracies=[4])  # it has not
    client.put("words", ["sure"], [[6, 0]])
    client.put("words", ["new"], [[9, 0]], accuracies=[1])
    assert told(client, "words") == [
        ("snapshot", None, "fence_created"),
        ("enter", "unsure", "subject_moved"),
        ("exit", "sure", "subject_moved"),
    ]
    client.put("words", ["new", "unsure"], [[3, 0], [5.5, 0]], accuracies=[3, 3])
    client.replace_fence("words", Circle(0, 0, 5), "words")
    assert told(client, "words", after=3) == [
        ("enter", "new", "fence_changed", "subject_moved"),
        ("exit", "unsure", "fence_changed", "subject_moved"),
    ]


def test_the_events_of_a_replacement_are_in_the_order_of_keys(client):
    client.create_hull("order", keyed="str")
    client.put("order", ["a", "b", "c"], [[4, 0], [7, 0], [4, 1]], accuracies=[2, 1, 2])
    client.create_fence("order", Circle(0, 0, 5), "order", by_accuracy=True, initial="none")
    client.replace_fence("order", Circle(0, 0, 9), "order", by_accuracy=True)
    assert told(client, "order") == [
        ("enter", "a", "fence_changed"),
        ("enter", "b", "fence_changed"),
        ("enter", "c", "fence_changed"),
    ]


def test_on_the_globe_nobody_is_certainly_inside_within_the_margin(client):
    """A perhaps that becomes one within the margin, outside of the area, is no certainty; 111 km are a degree."""
    client.create_hull("globe", keyed="str", geographic=True, center=(0, 0))
    client.create_fence(
        "globe", [(-1, -1), (1, -1), (1, 1), (-1, 1)], "globe", margin=50_000, by_accuracy=True, initial="none"
    )
    client.put("globe", ["van"], [(0.9, 0)], accuracies=[20_000])  # perhaps inside
    client.put("globe", ["van"], [(1.2, 0)], accuracies=[1_000])  # 22 km outside: within the margin
    assert told(client, "globe") == []
    client.put("globe", ["van"], [(0.9, 0)], accuracies=[1_000])
    client.put("globe", ["van"], [(1.5, 0)], accuracies=[10_000])  # 56 km outside: perhaps beyond the margin
    client.put("globe", ["van"], [(1.6, 0)], accuracies=[10_000])
    assert [event[:2] for event in told(client, "globe")] == [("enter", "van"), ("exit", "van")]


def test_an_area_that_moves_makes_subjects_certain(client):
    for name in ("pack", "yard"):
        client.create_hull(name, keyed="str")
    client.put("yard", ["a", "b", "c", "d"], [[0, 0], [4, 0], [4, 4], [0, 4]])
    client.put("pack", ["x"], [[3, 2]], accuracies=[2])
    client.create_fence("yard", "yard", "pack", by_accuracy=True, initial="events")
    client.put("yard", ["b", "c"], [[9, 0], [9, 4]])
    assert told(client, "yard") == []
    client.put("yard", ["a", "b", "c", "d"], [[0, -3], [9, -3], [9, 7], [0, 7]])
    client.put("yard", ["a", "d"], [[3, -3], [3, 7]])
    client.put("yard", ["a", "d"], [[6, -3], [6, 7]])
    assert told(client, "yard") == [("enter", "x", "area_moved"), ("exit", "x", "area_moved")]


def test_confirmations_begin_with_a_position_that_is_certain(client):
    client.create_hull("slow", keyed="str")
    client.put("slow", ["a"], [[9, 0]])
    client.create_fence("slow", Circle(0, 0, 5), "slow", by_accuracy=True, confirmations=2, initial="none")
    for x, error in [(4, 2), (4, 2), (3, 1), (9, 0), (3, 1), (3, 9), (9, 9), (3, 9), (3, 1), (4, 2)]:
        before = client.get_fence("slow").last_sequence
        client.put("slow", ["a"], [[x, 0]], accuracies=[error])
    assert (before, told(client, "slow")) == (1, [("enter", "a", "subject_moved")])


def test_accuracies_are_kept_with_positions(client, address):
    client.create_hull("kept", keyed="int", quarantine=Quarantine(max_growth=2.0))
    client.put("kept", [1, 2, 3], [[0, 0], [4, 0], [0, 4]], accuracies=[1.5, 0, 2.5])
    client.put("kept", [4], [[99, 99]], accuracies=[7])
    assert client.positions("kept", [3, 1, 9]).accuracies.tolist() == [2.5, 1.5, 0]
    assert client.entities("kept").accuracies.tolist() == [1.5, 0, 2.5]
    assert [part.accuracies.tolist() for part in client.read_points("kept")] == [[1.5, 0, 2.5]]
    assert [each.accuracy for each in client.list_held("kept")] == [7]
    client.release("kept", [4])
    assert client.entities("kept").accuracies.tolist() == [1.5, 0, 2.5, 7]
    client.put("kept", [1, 2], [[0, 0], [4, 0]], only="absent", accuracies=[9, 9])
    client.put("kept", [3], [[0, 4]])
    client.remove("kept", [4])
    client.put("kept", [4], [[1, 1]], only="absent")
    assert client.entities("kept").accuracies.tolist() == [1.5, 0, 0, 0]
    client.put("kept", [1], [[0, 0]])
    assert client.entities("kept").accuracies is None
    with client.feed("kept", after=0) as feed:
        batches = [next(feed) for _ in range(2)]
    assert batches[0].accuracies.tolist() == [1.5, 0, 2.5]
    with client.writer("kept") as writer:
        writer.put(keys=[1], points=[[0, 0]], accuracies=[3])
        writer.put(keys=[2], points=[[4, 0]])
        writer.put(keys=[3, 3], points=[[0, 4], [0, 3]], accuracies=[5, 6])
    with client.ingest("kept") as stream:
        stream.apply(keys=[4], points=[[1, 1]], accuracies=[8])
    assert client.entities("kept").accuracies.tolist() == [3, 0, 6, 8]

    async def asked():
        async with AsyncHullClient(address) as other:
            await other.put("kept", [2], [[4, 0]], accuracies=np.array([0.5]))
            return (await other.entities("kept")).accuracies.tolist()

    assert asyncio.run(asked()) == [3, 0.5, 6, 8]


@pytest.mark.parametrize("bad", [-1.0, float("nan"), float("inf")])
def test_bad_accuracies_are_refused_with_field_row_and_value(client, bad):
    for name in ("bad", "other"):
        client.create_hull(name, keyed="str", exist_ok=True)
    with pytest.raises(ValueError, match=f"accuracies row 1 is {bad}: must be finite and not negative"):
        client.put("bad", ["a", "b"], [[0, 0], [1, 1]], accuracies=[1, bad])
    batch = Batch(keys=["a", "b"], points=[[0, 0], [1, 1]])
    for encoding in ("packed", "values"):
        batch.message.puts.ClearField("accuracies")
        if encoding == "packed":
            batch.message.puts.accuracies.packed = np.array([0, bad]).tobytes()
        else:
            batch.message.puts.accuracies.values.extend([0, bad])
        with pytest.raises(InvalidRequestError) as refused:
            client.transfer({"bad": batch, "other": Batch(keys=["z"], points=[[0, 0]])})
        assert (refused.value.metadata["field"], refused.value.row) == ("batches[0].batch.puts.accuracies", 1)
        assert refused.value.metadata["value"] == str(bad)
    assert client.get_hull("bad").info.points == 0
    with pytest.raises(ValueError, match="2 keys and 1 accuracies"):
        client.put("bad", ["a", "b"], [[0, 0], [1, 1]], accuracies=[1])
    with pytest.raises(ValueError, match="are given with keys to put"):
        Batch(remove=["a"], accuracies=[1])


def test_doubts_and_accuracies_survive_kills(tmp_path):
    """On a server that is killed after each step, a life says what it says where nothing dies."""
    rng = random.Random(7)
    steps = [
        (
            {key: (rng.randint(0, 14) / 2, 0) for key in rng.sample(KEYS, 4)},
            [rng.choice([0, 0.5, 1, 3]) for _ in range(4)],
        )
        for _ in range(12)
    ]
    server = MortalServer(tmp_path)
    try:
        with HullClient(server.address) as client:
            for name in ("still", "killed"):
                client.create_hull(name, keyed="str", history=name == "killed")
                client.create_fence(name, Circle(0, 0, 5), name, by_accuracy=True, initial="none")
            for number, (places, errors) in enumerate(steps):
                for name in ("killed",) if number % 3 else ("still", "killed"):
                    client.put(name, list(places), list(places.values()), accuracies=errors)
                if number % 3:
                    client.put("still", list(places), list(places.values()), accuracies=errors)
                else:
                    server.kill()
                    server.start()
            assert told(client, "killed") == told(client, "still")
            assert len(told(client, "still")) > 5
            past = list(client.fence_events_between(Circle(0, 0, 5), "killed", by_accuracy=True, initial="none"))
            assert [(each.type, each.key, *sorted(each.cause)) for each in past] == told(client, "killed")
            middle = client.at("killed", 6)
            assert middle.entities().accuracies is not None
    finally:
        server.kill()
