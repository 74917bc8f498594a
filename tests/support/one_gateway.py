"""A server of one gateway and one worker, and what its watches cost the worker."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from metrics import samples
from patience import wait_until


@dataclass(frozen=True)
class Place:
    """A server of one gateway and one worker: its address, that of its metrics, and its file of tokens."""

    address: str
    metrics: str
    tokens: Path

    def costs(self, method: str = "Watch") -> tuple[float, float]:
        """The watches that the worker has now, and those of a method that it has ended."""
        found = samples(self.metrics)
        ended = (
            value
            for name, value in found.items()
            if name.startswith("dynhull_calls_total") and f'method="{method}"' in name and "worker" in name
        )
        return found['dynhull_watchers{process="worker-0"}'], sum(ended)

    def wait_for(self, watches: int) -> None:
        wait_until(lambda: self.costs()[0] == watches)


def entries(*tokens: str) -> str:
    return "".join(
        f'[[token]]\nsha256 = "{sha256(each.encode()).hexdigest()}"\nread = [""]\nwrite = [""]\n' for each in tokens
    )
