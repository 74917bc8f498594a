"""The metrics of several registries as those of one."""

from collections.abc import Iterable

from prometheus_client.metrics_core import Metric


def merged(found: dict[str, Iterable[Metric]], label: str) -> list[Metric]:
    """The metrics of several registries as those of one, with a label that tells them apart."""
    families: dict[str, Metric] = {}
    for process, own in found.items():
        for family in own:
            one = families.setdefault(family.name, Metric(family.name, family.documentation, family.type))
            for sample in family.samples:
                one.samples.append(sample._replace(labels={**sample.labels, label: process}))
    return list(families.values())
