"""The metrics of all processes on one page, with a label that names the process."""

import asyncio
from collections.abc import Iterable, Iterator, Sequence

from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.parser import text_string_to_metric_families
from prometheus_client.registry import Collector

from dynhull_server.rpc.call_counts import CallCounts

from .child_process import METRICS_SECONDS, ChildProcess
from .merged_metrics import merged

LABEL = "process"
SUPERVISOR = "supervisor"


def registry_of(
    processes: Sequence[ChildProcess], calls: CallCounts, loop: asyncio.AbstractEventLoop
) -> CollectorRegistry:
    """A registry that asks the processes, on the event loop, whenever another thread reads it.

    Args:
        processes: the processes.
        calls: what the supervisor has counted itself, on the event loop.
        loop: the event loop.
    """
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Collector(processes, calls, loop))
    return registry


class _Collector(Collector):
    def __init__(self, processes: Sequence[ChildProcess], calls: CallCounts, loop: asyncio.AbstractEventLoop) -> None:
        self._processes = processes
        self._calls = calls
        self._loop = loop

    def describe(self) -> Iterator[Metric]:
        """Nothing: the names are those that the processes have."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """The metrics of the processes that answer, and which of them serve."""
        asked = asyncio.run_coroutine_threadsafe(self._ask(), self._loop)
        pages, own = asked.result(2 * METRICS_SECONDS)
        found: dict[str, Iterable[Metric]] = {
            process: text_string_to_metric_families(page) for process, page in pages.items()
        }
        serving = GaugeMetricFamily("dynhull_process_serving", "Whether a process serves, and answers.", labels=[LABEL])
        starts = CounterMetricFamily("dynhull_process_starts", "Starts of a process.", labels=[LABEL])
        for each in self._processes:
            serving.add_metric([each.name], each.name in pages)
            starts.add_metric([each.name], each.starts)
        yield from (serving, starts, *merged({**found, SUPERVISOR: own}, LABEL))

    async def _ask(self) -> tuple[dict[str, str], list[Metric]]:
        pages = await asyncio.gather(*(each.metrics() for each in self._processes))
        found = {each.name: page for each, page in zip(self._processes, pages, strict=True) if page is not None}
        return found, self._calls.families()
