"""The programs of other languages, built as their pages say, beside a server that is killed."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from blocks import blocks
from command_line import dynhull
from mortal_server import MortalServer

pytestmark = [pytest.mark.long, pytest.mark.only_with("LANGUAGES_CASES")]
ROOT = Path(__file__).parents[2]
BUILDING = 1200  # seconds: a first build takes its packages from a registry
# A hundred packages of Rust take more than a minute of a processor: what they become stays there for the next run.
CARGO = {
    "CARGO_TARGET_DIR": str(ROOT / "build" / "rust"),
    "CARGO_PROFILE_DEV_DEBUG": "false",
    "CARGO_INCREMENTAL": "0",
}

LANGUAGES = {
    "go": ("go", ["./fleet"]),
    "java": ("mvn", ["sh", "-c", 'exec java -cp "target/classes:$(cat classpath)" Fleet "$0"']),
    "rust": ("cargo", ["sh", "-c", 'exec "$CARGO_TARGET_DIR/debug/fleet" "$0"']),
}


@pytest.mark.timeout(BUILDING)
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_program_goes_on_after_the_server_was_killed(language: str, site: Path, tmp_path: Path) -> None:
    tool, command = LANGUAGES[language]
    if not shutil.which(tool):
        pytest.skip(f"no {tool}")
    folder, page = tmp_path / "program", [*blocks((site / "how-to" / language / "index.html").read_text())]
    for block in page:
        if block.title:
            (folder / block.title).parent.mkdir(parents=True, exist_ok=True)
            (folder / block.title).write_text(block.text.replace("PROTO", str(ROOT / "proto")))
    lines = [line.split() for block in page for line in block.text.splitlines()]
    (moves,) = [words[1:] for words in lines if words[:2] == ["dynhull", "put"]]
    environment = os.environ | CARGO
    built = subprocess.run(
        ["sh", "-eu", "build.sh"], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stdout + built.stderr
    server = MortalServer(tmp_path)
    with subprocess.Popen(
        [*command, server.address], cwd=folder, env=environment, stdout=subprocess.PIPE, text=True
    ) as program:
        assert program.stdout is not None
        assert [program.stdout.readline() for _ in range(3)] == ["1\n", "0\n", "-1\n"]
        first = program.stdout.readline()
        server.kill()
        server.start()
        done = dynhull(*moves, env={"DYNHULL_ADDRESS": server.address})
        assert done.exit_code == 0, done.stderr
        second = program.stdout.readline()
        program.kill()
    server.kill()
    assert first.startswith("revision 1: 3 points")
    assert "snapshot" in first.lower()
    assert second.startswith("revision 2: 4 points")
    assert "change" in second.lower()
