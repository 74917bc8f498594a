"""The processes of tests that are forked start fast because they have imported all they need before."""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryFile

import forked

SERVE = f"""
import sys
sys.path.insert(0, {str(Path(forked.__file__).parent)!r})
import forked
command = [forked.COMMAND, "serve", "--port", "0", "--in-memory"]
forked.import_for(command)
print("forked", file=sys.stderr)
sys.argv = command
from dynhull_cli.main import main
main()
"""


def test_a_server_imports_nothing_of_ours_after_the_fork() -> None:
    """Once a module that it runs was missing there: each of a thousand servers took three times as long."""
    command = [sys.executable, "-X", "importtime", "-c", SERVE]
    with (
        TemporaryFile("w+") as imported,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=imported, text=True) as process,
    ):
        assert process.stdout.readline().startswith("dynhull serving")
        process.terminate()
        process.wait()
        imported.seek(0)
        lines = imported.read().splitlines()
    after = (line.split("|")[-1].strip() for line in lines[lines.index("forked") :])
    assert [module for module in after if module.startswith("dynhull")] == []
