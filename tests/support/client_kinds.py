"""Both clients behind one interface, so that one test runs on both."""

import asyncio
import concurrent.futures
import inspect
import threading
from functools import cache

from dynhull_client import AsyncHullClient, HullClient


@cache
def loop() -> asyncio.AbstractEventLoop:
    """An event loop that runs in a thread until the tests end."""
    running = asyncio.new_event_loop()
    threading.Thread(target=running.run_forever, daemon=True).start()
    return running


def wait(function, *arguments, **options):
    """Call a function on the loop, await what it returns if necessary, and return the result.

    A future becomes one for threads.
    """

    async def call():
        result = function(*arguments, **options)
        if isinstance(result, asyncio.Future):
            return threaded(result)
        return await result if inspect.isawaitable(result) else result

    return Waiting.of(asyncio.run_coroutine_threadsafe(call(), loop()).result())


def threaded(future: asyncio.Future) -> concurrent.futures.Future:
    """A future for threads with the outcome of one of the loop."""
    outcome = concurrent.futures.Future()

    def done(_: asyncio.Future) -> None:
        if future.cancelled():
            outcome.cancel()
        elif future.exception() is not None:
            outcome.set_exception(future.exception())
        else:
            outcome.set_result(future.result())

    future.add_done_callback(done)
    return outcome


class Waiting:
    """An object of the asyncio client whose methods block and whose iterators and contexts are synchronous."""

    def __init__(self, inner):
        self._inner = inner

    @classmethod
    def of(cls, value):
        return cls(value) if type(value).__name__.startswith(("Async", "async")) else value

    def __getattr__(self, name):
        value = getattr(self._inner, name)
        return (lambda *arguments, **options: wait(value, *arguments, **options)) if callable(value) else value

    def __iter__(self):
        return self

    def __next__(self):
        try:
            return wait(self._inner.__anext__)
        except StopAsyncIteration:
            raise StopIteration from None

    def __enter__(self):
        wait(self._inner.__aenter__)
        return self

    def __exit__(self, *error):
        return wait(self._inner.__aexit__, *error)


CLIENTS = {"sync": HullClient, "asyncio": lambda *arguments, **options: wait(AsyncHullClient, *arguments, **options)}
