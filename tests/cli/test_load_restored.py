"""A load beside a server whose folder is replaced by a backup."""

import subprocess
from contextlib import ExitStack
from pathlib import Path

from command_line import dynhull
from forked import COMMAND, Process
from mortal_server import MortalServer
from patience import PATIENCE, wait_until

from dynhull_client import HullClient

BATCH = 8192
LINES = [f"{number} {number * number}\n" for number in range(3 * BATCH)]


def test_a_load_ends_and_goes_on_after_the_last_batch_that_is_kept(tmp_path: Path) -> None:
    server = MortalServer(tmp_path)
    with ExitStack() as stack:
        stack.callback(server.kill)
        client = stack.enter_context(HullClient(server.address))
        client.create_hull("track")
        options = "--address", server.address, "--producer", "gps"
        command = [COMMAND, "load", "track", "-", *options]
        load = stack.enter_context(
            Process(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        )

        def send(batch: int) -> None:
            load.stdin.write("".join(LINES[(batch - 1) * BATCH : batch * BATCH]))
            load.stdin.flush()

        send(1)
        wait_until(lambda: client.get_hull("track").info.revision == 1)
        assert dynhull("backup", tmp_path / "backup", "--data", tmp_path / "data").exit_code == 0
        send(2)
        wait_until(lambda: client.get_hull("track").info.revision == 2)
        server.kill()
        (tmp_path / "data").rename(tmp_path / "lost")
        assert dynhull("restore", tmp_path / "backup", "--data", tmp_path / "data").exit_code == 0
        server.start()
        send(3)
        _, said = load.communicate(timeout=PATIENCE)
        assert load.returncode == 1
        assert "was restored from a backup" in said
        assert "Of the points acknowledged so far, the hull lacks some. The same command with --resume" in said
        again = dynhull("load", "track", "-", "--resume", *options, input="".join(LINES).encode())
        assert again.exit_code == 0, again.stderr
        assert client.get_hull("track").info.points == len(LINES)
