"""The futures of writers and pipelines are futures like all others, whenever and however somebody looks at them."""

import asyncio
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future, as_completed, wait
from contextlib import suppress

import pytest
from patience import PATIENCE

from dynhull_client import HullClient, InvalidRequestError
from dynhull_client._messages import Applied


@pytest.fixture
def client(address: str, name: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        client.create_hull(name)
        yield client


def puts(client: HullClient, name: str, number: int) -> list[Future[Applied]]:
    """Outcomes of a writer that is closed: all of them have a result."""
    with client.writer(name, batch_points=1) as writer:
        return [writer.put(insert=[[i, i * i]]) for i in range(number)]


def test_everything_that_waits_for_futures_waits_for_these(client: HullClient, name: str) -> None:
    with client.writer(name, batch_points=1) as writer:
        outcomes = [writer.put(insert=[[i, i * i]]) for i in range(400)]
        called: list[int] = []
        for each in outcomes[:100]:
            each.add_done_callback(lambda outcome: called.append(outcome.result().revision))

        async def gathered() -> list[Applied]:
            return await asyncio.gather(*map(asyncio.wrap_future, outcomes[100:200]))

        assert [each.revision for each in asyncio.run(gathered())] == list(range(101, 201))
        found = {each.result().revision for each in as_completed(outcomes[200:300], PATIENCE)}
        assert found == set(range(201, 301))
        assert wait(outcomes, PATIENCE).not_done == set()
        assert [each.result().revision for each in outcomes] == list(range(1, 401))
        assert sorted(called) == list(range(1, 101))


def test_threads_that_look_while_a_future_gets_its_result_see_it(client: HullClient, name: str) -> None:
    """Each outcome is waited for by several threads, from before it is sent or just when it arrives."""
    seen: list[list[int]] = [[] for _ in range(4)]
    with client.writer(name, batch_points=1) as writer:
        outcomes = [writer.put(insert=[[i, i * i]]) for i in range(1000)]

        def look(into: list[int], step: int) -> None:
            into.extend(each.result(PATIENCE).revision for each in outcomes[::step])

        threads = [threading.Thread(target=look, args=(into, 1 if i % 2 else -1)) for i, into in enumerate(seen)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
    assert seen == [list(range(1000, 0, -1)), list(range(1, 1001))] * 2


def test_what_is_done_says_so_without_waiting(client: HullClient, name: str) -> None:
    for outcome in puts(client, name, 3):
        assert outcome.done()
        assert not outcome.cancelled()
        assert not outcome.running()
        assert outcome.exception(0) is None
        assert outcome.result(0).inserted == 1
        assert not outcome.cancel()
        assert "finished" in repr(outcome)


def test_a_refusal_is_the_error_of_the_future(client: HullClient, name: str) -> None:
    with client.pipeline() as pipe:
        refused = [pipe.locate(name, [[0, 0]], layer=10**6) for _ in range(2)]
        pipe.flush()
        for each in refused:
            assert isinstance(each.exception(0), InvalidRequestError)
            with pytest.raises(InvalidRequestError):
                each.result()


def test_cancelling_drops_the_answer_alone(client: HullClient, name: str) -> None:
    with client.writer(name, linger=60) as writer:
        outcome = writer.put(insert=[[1, 1]])
        with pytest.raises(TimeoutError):
            outcome.result(0.01)
        assert not outcome.done()
        assert outcome.cancel()
        assert outcome.done()
        with pytest.raises(CancelledError):
            outcome.result()
    assert client.get_hull(name).info.points == 1


def test_those_who_wait_for_several_futures_hear_of_cancelled_ones(client: HullClient, name: str) -> None:
    writer = client.writer(name, linger=60)
    with suppress(ZeroDivisionError), writer:
        outcome = writer.put(insert=[[1, 1]])
        raise ZeroDivisionError
    assert outcome.cancelled()
    assert outcome.cancel()
    assert wait([outcome], PATIENCE).not_done == set()


@pytest.fixture
def _threads_take_turns_often() -> Iterator[None]:
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual)


@pytest.mark.usefixtures("_threads_take_turns_often")
def test_a_future_cancelled_just_when_it_gets_its_result_harms_no_other(client: HullClient, name: str) -> None:
    with client.writer(name, batch_points=1) as writer:
        for begin in range(0, 3000, 300):
            outcomes = [writer.put(insert=[[i, i * i]]) for i in range(begin, begin + 300)]
            threads = [threading.Thread(target=lambda: [each.cancel() for each in outcomes]) for _ in range(3)]  # noqa: B023
            for each in threads:
                each.start()
            for each in threads:
                each.join()
            writer.flush()
    assert client.get_hull(name).info.points == 3000
