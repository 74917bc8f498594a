"""The programs of other languages, built as their pages say, beside a server that is killed."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from blocks import blocks
from mortal_server import MortalServer

from dynhull_client import HullClient

pytestmark = [pytest.mark.long, pytest.mark.only_with("LANGUAGES_CASES")]
ROOT = Path(__file__).parents[2]
BUILDING = 1200  # seconds: a first build takes its packages from a registry

LANGUAGES = {
    "go": ("go", ["./fleet"]),
    "java": ("mvn", ["sh", "-c", 'java -cp "target/classes:$(cat classpath)" Fleet "$0"']),
    "rust": ("cargo", ["target/debug/fleet"]),
}


@pytest.fixture
def take_all(site: Path, tmp_path: Path) -> Callable[[str], Path]:
    """Saves all blocks with a title of a page, as a reader would."""

    def take(page: str) -> Path:
        for block in blocks((site / page / "index.html").read_text()):
            if block.title:
                file = tmp_path / "program" / block.title
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(block.text.replace("PROTO", str(ROOT / "proto")))
        return tmp_path / "program"

    return take


@pytest.mark.timeout(BUILDING)
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_program_goes_on_after_the_server_was_killed(
    language: str, take_all: Callable[[str], Path], tmp_path: Path
) -> None:
    tool, command = LANGUAGES[language]
    if not shutil.which(tool):
        pytest.skip(f"no {tool}")
    folder = take_all(f"how-to/{language}")
    built = subprocess.run(["sh", "-eu", "build.sh"], cwd=folder, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    server = MortalServer(tmp_path)
    with subprocess.Popen([*command, server.address], cwd=folder, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert [program.stdout.readline() for _ in range(3)] == ["1\n", "0\n", "-1\n"]
        first = program.stdout.readline()
        server.kill()
        server.start()
        with HullClient(server.address) as client:
            client.put("convoy", ["south"], [(0, -9)])
        second = program.stdout.readline()
        program.kill()
    server.kill()
    assert first.startswith("revision 1: 3 points")
    assert "snapshot" in first.lower()
    assert second.startswith("revision 2: 4 points")
    assert "change" in second.lower()
