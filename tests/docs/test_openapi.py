"""What programs of others make of the gateway's description compiles, and the program on its page runs with it."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from blocks import blocks
from gateway_process import Gateway, gateway_process
from peers import program
from server_process import server_process

pytestmark = [pytest.mark.long, pytest.mark.only_with("LANGUAGES_CASES")]
TOOLS = Path(__file__).parents[2] / "build" / "openapi"
STRICT = {"strict": True, "target": "es2022", "module": "esnext", "moduleResolution": "bundler"}
MOST = 300  # seconds


@pytest.fixture(scope="module")
def gateway() -> Iterator[Gateway]:
    with server_process() as server, gateway_process(server.address) as running:
        yield running


@pytest.fixture
def folder(gateway: Gateway, tmp_path: Path) -> Path:
    """A folder with the description, and the packages of npm."""
    if not (TOOLS / "node_modules").is_dir():
        pytest.skip("no packages that read OpenAPI, which `make languages` takes from npm")
    (tmp_path / "openapi.json").write_bytes(gateway.get("/openapi.json").body)
    (tmp_path / "node_modules").symlink_to(TOOLS / "node_modules")
    (tmp_path / "package.json").write_text('{"type": "module"}')
    (tmp_path / "tsconfig.json").write_text(json.dumps({"compilerOptions": STRICT, "include": ["**/*.ts"]}))
    return tmp_path


def run(folder: Path, *command: str) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=MOST, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def tool(name: str) -> str:
    return str(TOOLS / "node_modules" / ".bin" / name)


def test_a_program_with_types_of_openapi_typescript(folder: Path, gateway: Gateway, site: Path) -> None:
    page = (site / "how-to" / "browser" / "index.html").read_text()
    (written,) = [each for each in blocks(page) if each.title == "fleet.ts"]
    (folder / written.title).write_text(written.text.replace("http://127.0.0.1:8080", gateway.url))
    run(folder, tool("openapi-typescript"), "openapi.json", "-o", "hulls.d.ts")
    run(folder, tool("tsc"))
    assert run(folder, program("node"), "fleet.js") == "1 [ [ 0, 0 ], [ 4, 0 ], [ 4, 4 ] ]\n"


def test_what_openapi_generator_makes(folder: Path) -> None:
    generator = next(TOOLS.glob("openapi-generator-cli-*.jar"), None)
    if generator is None or not shutil.which("java"):
        pytest.skip("no openapi-generator, which Maven brings, or no Java, in which it runs")
    run(
        folder, "java", "-jar", str(generator), "generate", "-g", "typescript-fetch", "-i", "openapi.json", "-o", "made"
    )
    assert (folder / "made" / "models" / "PolygonArea.ts").exists()
    run(folder, tool("tsc"), "--noEmit")


def test_redocly_finds_nothing(folder: Path) -> None:
    run(folder, tool("redocly"), "lint", "--max-problems", "20", "openapi.json")
