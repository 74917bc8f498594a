"""The program of the README that talks to a server; the other one is a doctest."""

import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).parents[2] / "README.md"


def test_a_writer_and_a_watcher(address: str, tmp_path: Path) -> None:
    (source,) = re.findall(r"```python\n(from dynhull_client.*?)```", README.read_text(), re.DOTALL)
    program = tmp_path / "program.py"
    program.write_text(source.replace("127.0.0.1:50051", address))
    with subprocess.Popen([sys.executable, "-u", str(program)], stdout=subprocess.PIPE, text=True) as running:
        try:
            printed = [running.stdout.readline() for _ in range(3)]
        finally:
            running.kill()
    assert "".join(printed) == "2 [[0. 0.]\n [4. 0.]\n [9. 9.]]\n"
