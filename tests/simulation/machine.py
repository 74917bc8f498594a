"""A machine in which time is simulated and threads take turns: the event loop, and greenlets for threads.

The loop is first in, first out, as asyncio's is, one callback a turn, or in brisk lives often all that are ready; time
passes in turns of its own, from timer to
timer. A thread runs until it waits, or gives way where it would for a disk.
"""

import asyncio
import heapq
import sys
from collections import deque
from collections.abc import AsyncGenerator, Callable, Coroutine
from concurrent.futures import Future
from contextlib import suppress
from contextvars import Context
from functools import partial
from threading import get_ident
from typing import Any

from greenlet import GreenletExit, getcurrent, greenlet

from dynhull_server.engine.threads import Clock, Machine, Threads

from .model import Finding, Model
from .schedule import Schedule

# Pauses are as long as the work before them, in which other pauses may pass here: they would grow without end.
LONGEST_PAUSE = 60.0
# How often a brisk loop carries out all that is ready.
ALL_AT_ONCE = 0.8
# As many as are asked for.
MANY_THREADS = 1_000


class Loop(asyncio.AbstractEventLoop):
    """An event loop in simulated time.

    Attributes:
        now: seconds since the life began.
        dead: whether the process has been killed.
        tasks: all tasks.
    """

    now = 0.0

    def __init__(self, model: Model, schedule: Schedule) -> None:
        self.dead = False
        self.tasks: list[asyncio.Task[Any]] = []
        self._model = model
        self._schedule = schedule
        self._ready: deque[asyncio.Handle] = deque()
        self._timers: list[tuple[float, int, asyncio.TimerHandle]] = []
        self._timer_count = 0
        self._executor: Callable[[Callable[[], Any]], Future[Any]] | None = None
        schedule.actor("loop", self._is_ready, self._run)
        schedule.actor("time", self._may_pass, self._pass)

    def _run(self) -> None:
        all_of_them = self._schedule.brisk and len(self._ready) > 1 and self._schedule.random.random() < ALL_AT_ONCE
        asyncio._set_running_loop(self)
        hooks = sys.get_asyncgen_hooks()
        sys.set_asyncgen_hooks(finalizer=self._dropped)
        try:
            for _ in range(len(self._ready) if all_of_them else 1):
                handle = self._ready.popleft()
                if not handle.cancelled():
                    handle._run()
        finally:
            sys.set_asyncgen_hooks(*hooks)
            asyncio._set_running_loop(None)

    def _dropped(self, generator: AsyncGenerator[Any, Any]) -> None:
        """What nobody reads any more ends, as in asyncio; nothing of a killed process does."""
        if not self.dead:
            self.create_task(generator.aclose())

    def _is_ready(self) -> object:
        """Whether anything can be carried out now."""
        return self._ready

    def _may_pass(self) -> object:
        """Whether time may pass to the next timer."""
        return self._timers

    def _pass(self) -> None:
        before, self.now = self.now, max(self.now, self._timers[0][0])
        self._model.elapsed += self.now - before
        while self._timers and self._timers[0][0] <= self.now:
            self._ready.append(heapq.heappop(self._timers)[2])

    # What asyncio and the engine ask for

    def time(self) -> float:
        return self.now

    def get_debug(self) -> bool:
        return False

    def is_running(self) -> bool:
        return True

    def is_closed(self) -> bool:
        return self.dead

    def call_soon(self, callback: Any, *args: Any, context: Context | None = None) -> asyncio.Handle:
        handle = asyncio.Handle(callback, args, self, context)
        self._ready.append(handle)
        return handle

    call_soon_threadsafe = call_soon

    def call_later(
        self, delay: float, callback: Any, *args: Any, context: Context | None = None
    ) -> asyncio.TimerHandle:
        return self.call_at(self.now + delay, callback, *args, context=context)

    def call_at(self, when: float, callback: Any, *args: Any, context: Context | None = None) -> asyncio.TimerHandle:
        handle = asyncio.TimerHandle(when, callback, args, self, context)
        self._timer_count += 1
        heapq.heappush(self._timers, (when, self._timer_count, handle))
        return handle

    def _timer_handle_cancelled(self, handle: asyncio.TimerHandle) -> None:
        """It is passed over when its time comes."""

    def create_future(self) -> "asyncio.Future[Any]":
        return asyncio.Future(loop=self)

    def create_task(self, coro: Coroutine[Any, Any, Any], **options: Any) -> "asyncio.Task[Any]":  # type: ignore[override]
        task = asyncio.Task(coro, loop=self, **options)
        self.tasks.append(task)
        return task

    def run_in_executor(self, _: Any, function: Any, *args: Any) -> Any:
        assert self._executor is not None
        return asyncio.wrap_future(self._executor(lambda: function(*args)), loop=self)

    def executor(self, submit: Callable[[Callable[[], Any]], "Future[Any]"]) -> None:
        """Where functions of `asyncio.to_thread` run."""
        self._executor = submit

    def call_exception_handler(self, context: dict[str, Any]) -> None:
        """What asyncio would log and forget is a finding."""
        if not self.dead:
            self._model.finds(f"{context.get('message')}: {context.get('exception')!r}")

    def kill(self) -> None:
        """End the process: its last answers reach no client."""
        self.dead = True
        for task in self.tasks:
            task._log_destroy_pending = False  # type: ignore[attr-defined]
            with suppress(Exception, Finding, BaseExceptionGroup):
                task.get_coro().close()  # type: ignore[union-attr]


class Thread:
    """A thread: runs at its turns, until it waits."""

    def __init__(self, hub: greenlet, run: Callable[[], None]) -> None:
        self._hub = hub
        self._greenlet = greenlet(run, hub)  # also where another thread starts it: its end goes on there
        self._condition: Callable[[], object] | None = None

    @property
    def done(self) -> bool:
        return bool(self._greenlet.dead)

    def ready(self) -> object:
        return not self.done and (self._condition is None or self._condition())

    def act(self) -> None:
        self._condition = None
        self._greenlet.switch()

    def wait(self, condition: Callable[[], object] | None) -> None:
        """Called in the thread: let others go on until the condition holds."""
        self._condition = condition
        self._hub.switch()

    def owns(self, current: greenlet) -> bool:
        return self._greenlet is current

    def kill(self) -> None:
        if not self.done:
            self._greenlet.throw(GreenletExit)


class SimulatedThreads(Threads):
    """Makes simulated threads."""

    def __init__(self, model: Model, schedule: Schedule) -> None:
        self._model = model
        self._schedule = schedule
        self._hub = getcurrent()
        self._all: list[Thread] = []
        self._pools: list[_Pool] = []
        self._ahead: _Pool | None = None

    def current(self) -> Thread | None:
        """The thread that runs, None for the event loop's."""
        current = getcurrent()
        if current is self._hub:
            return None
        for thread in reversed(self._all):
            if thread.owns(current):
                return thread
        raise self._model.finds(f"{current} in {get_ident()} is no thread of this life")

    def wait(self, condition: Callable[[], object]) -> None:
        """Let the current thread wait."""
        if condition():
            return
        thread = self.current()
        if thread is None:
            raise self._model.finds("the event loop blocks")
        thread.wait(condition)

    def give_way(self) -> None:
        """Let others go on; the current thread may go on at any time."""
        thread = self.current()
        if thread is not None:
            thread.wait(None)

    def start(self, run: Callable[[], None]) -> Thread:
        """A new thread, for its owner to schedule."""

        def guarded() -> None:
            with suppress(Finding, GreenletExit):  # the model knows
                run()

        thread = Thread(self._hub, guarded)
        self._all = [each for each in self._all if not each.done]
        self._all.append(thread)
        return thread

    def pool(self, name: str, size: int) -> "_Pool":
        """A pool of simulated threads."""
        pool = _Pool(self, size, self._schedule)
        self._pools.append(pool)
        self._schedule.actor(name, pool.ready, pool.act)
        return pool

    def inbox(self) -> Any:
        """A queue into a thread."""
        return _Inbox(self)

    def spawn(self, name: str, run: Callable[[], None], died: Callable[[BaseException], None]) -> Any:
        """A thread that its owner hears of."""

        def guarded() -> None:
            try:
                run()
            except GreenletExit:
                raise
            except BaseException as error:
                died(error)

        thread = self.start(guarded)
        self._schedule.actor(name, thread.ready, thread.act)
        return _Spawned(self, thread)

    def ahead(self) -> "_Pool":
        """The threads that read ahead; they are made with the first of them."""
        if self._ahead is None:
            self._ahead = self.pool("ahead", MANY_THREADS)
        return self._ahead

    def kill(self) -> None:
        """End all threads."""
        for thread in self._all:
            thread.kill()


class _Spawned:
    def __init__(self, threads: SimulatedThreads, thread: Thread) -> None:
        self._threads, self._thread = threads, thread

    def join(self) -> None:
        self._threads.wait(lambda: self._thread.done)


class _Inbox:
    def __init__(self, threads: SimulatedThreads) -> None:
        self._threads = threads
        self._items: list[Any] = []
        self._closed = False

    def put(self, item: Any) -> None:
        if self._closed:
            raise RuntimeError("the inbox is closed")
        self._items.append(item)

    def take(self, *, wait: bool = True) -> list[Any]:
        if wait:
            self._threads.wait(lambda: self._items or self._closed)
        items, self._items = self._items, []
        return items

    def close(self) -> None:
        self._closed = True


class _Pool:
    def __init__(self, threads: SimulatedThreads, size: int, schedule: Schedule) -> None:
        self._threads = threads
        self._size = size
        self._schedule = schedule
        self._jobs: deque[tuple[Future[Any], Callable[[], Any]]] = deque()
        self._running: list[Thread] = []
        self._shut = False

    def submit(self, function: Callable[[], Any]) -> "Future[Any]":
        if self._shut:
            raise RuntimeError("cannot schedule new futures after shutdown")
        future: Future[Any] = Future()
        self._jobs.append((future, function))
        return future

    def shutdown(self) -> None:
        self._shut = True
        self._threads.wait(lambda: not self._jobs and not self._running)

    def ready(self) -> object:
        if self._jobs and len(self._running) < self._size:
            return True
        return self._running and any(thread.ready() for thread in self._running)

    def act(self) -> None:
        ready = [thread for thread in self._running if thread.ready()]
        if self._jobs and len(self._running) < self._size and (not ready or self._schedule.random.random() < 0.5):
            thread = self._start(*self._jobs.popleft())
        else:
            thread = self._schedule.random.choice(ready)
        thread.act()
        if thread.done:
            self._running.remove(thread)

    def _start(self, future: "Future[Any]", function: Callable[[], Any]) -> Thread:
        def job() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                result = function()
            except GreenletExit:
                raise
            except BaseException as error:
                future.set_exception(error)
                if isinstance(error, Finding):
                    raise
            else:
                future.set_result(result)

        thread = self._threads.start(job)
        self._running.append(thread)
        return thread


def reading_ahead(threads: Callable[[], SimulatedThreads]) -> tuple[type, type]:
    """What takes the place of `Thread` and `Future` where one thread reads what others wait for."""

    class Ahead:
        def __init__(self, target: Callable[..., None], args: tuple[Any, ...], name: str) -> None:
            del name
            self._run = partial(target, *args)
            self._done: Future[None] | None = None

        def start(self) -> None:
            self._done = threads().ahead().submit(self._run)

        def is_alive(self) -> bool:
            return self._done is not None and not self._done.done()

    class Read(Future[Any]):
        def result(self, timeout: float | None = None) -> Any:
            threads().wait(self.done)
            return super().result(timeout)

    return Ahead, Read


class SimulatedClock(Clock):
    """Simulated time."""

    def __init__(self, loop: Loop, model: Model) -> None:
        self._loop = loop
        self._model = model

    def monotonic(self) -> float:
        return self._loop.now

    def wall(self) -> float:
        return self._model.wall + self._loop.now

    async def sleep(self, seconds: float) -> None:
        await asyncio.sleep(min(seconds, LONGEST_PAUSE))


def simulated_machine(loop: Loop, threads: SimulatedThreads, model: Model) -> Machine:
    """All seams together."""
    return Machine(SimulatedClock(loop, model), threads, model.uid)
