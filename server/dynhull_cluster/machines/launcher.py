"""Ray as a launcher: an actor for each server of a cluster, which Ray places on its nodes, and restarts elsewhere.

An actor starts `dynhull serve --cluster` as a process of its own and waits for its end. Callers, gateways and workers
never go through Ray, and nothing of Ray decides who serves what.
"""

import os
import secrets
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from typing import Any

NAMESPACE = "dynhull"
PREFIX = "server-"
# Seconds that a server gets to give up its partitions before its actor is ended.
STOP_SECONDS = 60.0
# Runs the command line in a process that ends when the one that has started it does (prctl, PR_SET_PDEATHSIG).
COMMAND = (
    "import ctypes, signal; ctypes.CDLL(None).prctl(1, signal.SIGTERM); from dynhull_cli.main import main; main()",
    "serve",
    "--cluster",
)


class Launched:
    """What an actor does: it keeps a server, and ends with it, so that Ray starts both anew.

    Args:
        options: the options of `dynhull serve`.
        environment: variables to set.
        host: the address for the other servers; empty for that of the node.
    """

    def __init__(self, options: Sequence[str], environment: dict[str, str], host: str) -> None:
        import ray

        own: str = host or ray.util.get_node_ip_address()  # type: ignore[no-untyped-call]
        command = [sys.executable, "-c", *COMMAND, "--cluster-host", own, *options]
        self._process = subprocess.Popen(  # noqa: S603  # ours, with the options of the operator
            command, stdout=subprocess.PIPE, text=True, env={**os.environ, **environment}
        )
        assert self._process.stdout is not None
        self._said = self._process.stdout.readline().strip()
        self._stopping = False
        threading.Thread(target=self._wait, daemon=True).start()

    def serving(self) -> str:
        """What the server has said first: its address."""
        return self._said

    def processes(self) -> tuple[int, int]:
        """The numbers of this process and of the server's."""
        return os.getpid(), self._process.pid

    def stop(self) -> None:
        """Stop the server, which gives up its partitions first."""
        self._stopping = True
        self._process.terminate()
        self._process.wait(STOP_SECONDS)

    def _wait(self) -> None:
        code = self._process.wait()
        if not self._stopping:
            os._exit(code or os.EX_SOFTWARE)


def start_ray() -> bool:
    """Use the Ray of RAY_ADDRESS, or start one that ends with this process; returns whether it did that."""
    # Ray counts its users unless asked not to, and without a token puts one into the home folder.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    own = "RAY_ADDRESS" not in os.environ
    if own and not {"RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"} & set(os.environ):
        os.environ |= {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(16)}
    import ray

    if own:
        folder = tempfile.mkdtemp(prefix="ray-")
        ray.init(
            address="local",
            namespace=NAMESPACE,
            include_dashboard=False,
            object_store_memory=2**27,
            log_to_driver=False,
            _temp_dir=folder,
            _node_ip_address="127.0.0.1",
        )
    else:
        ray.init(namespace=NAMESPACE, log_to_driver=False)
    return own


def servers() -> dict[int, Any]:
    """The actors, by number."""
    import ray

    names = [name for name in ray.util.list_named_actors() if name.startswith(PREFIX)]
    return {int(name.removeprefix(PREFIX)): ray.get_actor(name) for name in names}


def scale(count: int, options: Sequence[str], environment: dict[str, str], host: str) -> dict[int, str]:
    """Have Ray run that many servers, and wait until they serve.

    Args:
        count: how many.
        options: the options of `dynhull serve` for those that are started.
        environment: variables for them.
        host: the address for the other servers; empty for that of the node.

    Returns:
        What each of them has said first.
    """
    import ray

    actor = ray.remote(Launched)
    present = servers()
    for number in sorted(set(range(count)) - set(present)):
        present[number] = actor.options(
            name=f"{PREFIX}{number}",
            lifetime="detached",
            max_restarts=-1,
            max_task_retries=-1,
            num_cpus=1,
            scheduling_strategy="SPREAD",
            max_concurrency=2,
        ).remote(list(options), environment, host)
    for number in sorted(set(present) - set(range(count))):  # one after the other: each moves its partitions
        leaving = present.pop(number)
        ray.get(leaving.stop.remote())
        ray.kill(leaving)
    said = ray.get([each.serving.remote() for each in present.values()])
    return dict(zip(present, said, strict=True))
