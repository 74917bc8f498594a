"""A server with fences: so far they are in the reference geometry, and not in the kernel."""

from functools import partial

from server_process import server_process

fence_server = partial(server_process, wrap=("env", "DYNHULL_KERNEL=python"))
