"""The metrics of all processes on one page, with a label that names the process."""

import asyncio
from collections.abc import Iterator, Sequence

from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.parser import text_string_to_metric_families
from prometheus_client.registry import Collector

from .child_process import METRICS_SECONDS, ChildProcess

LABEL = "process"


def registry_of(processes: Sequence[ChildProcess], loop: asyncio.AbstractEventLoop) -> CollectorRegistry:
    """A registry that asks the processes, on the event loop, whenever another thread reads it."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Collector(processes, loop))
    return registry


class _Collector(Collector):
    def __init__(self, processes: Sequence[ChildProcess], loop: asyncio.AbstractEventLoop) -> None:
        self._processes = processes
        self._loop = loop

    def describe(self) -> Iterator[Metric]:
        """Nothing: the names are those that the processes have."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """The metrics of the processes that answer, and which of them serve."""
        asked = asyncio.run_coroutine_threadsafe(self._ask(), self._loop)
        pages = asked.result(2 * METRICS_SECONDS)
        serving = GaugeMetricFamily("dynhull_process_serving", "Whether a process serves.", labels=[LABEL])
        starts = CounterMetricFamily("dynhull_process_starts", "Starts of a process.", labels=[LABEL])
        for each in self._processes:
            serving.add_metric([each.name], each.serving.is_set())
            starts.add_metric([each.name], each.starts)
        yield from (serving, starts, *_merged(pages))

    async def _ask(self) -> dict[str, str]:
        pages = await asyncio.gather(*(each.metrics() for each in self._processes))
        return {each.name: page for each, page in zip(self._processes, pages, strict=True) if page is not None}


def _merged(pages: dict[str, str]) -> list[Metric]:
    families: dict[str, Metric] = {}
    for process, page in pages.items():
        for family in text_string_to_metric_families(page):
            merged = families.setdefault(family.name, Metric(family.name, family.documentation, family.type))
            for sample in family.samples:
                merged.samples.append(sample._replace(labels={**sample.labels, LABEL: process}))
    return list(families.values())
