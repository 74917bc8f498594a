"""The programs for other languages, copied from their page and run against a real server."""

import os
import shutil
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import pytest
from peers import missing
from run_in import run

ROOT = Path(__file__).parents[2]
DEFAULT_ADDRESS = "127.0.0.1:50051"
SCRIPTS = Path(sys.executable).parent


@pytest.mark.parametrize("tool", ["buf", "grpcurl"])
def test_command_line(tool: str, take_program: Callable[[str, str], Path], address: str, tmp_path: Path) -> None:
    path = f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}"
    if tool == "grpcurl" and not shutil.which(tool, path=path):
        if shutil.which("go"):
            missing(tool, "run `make peers`")
        pytest.skip("no go: install Go, which builds grpcurl (see `make peers`)")
    script = take_program("how-to/other-languages", f"{tool}.sh")
    script.write_text(script.read_text().replace(DEFAULT_ADDRESS, address))
    printed = run("bash", "-eu", str(script), folder=tmp_path, PATH=path)
    assert "dynhull.v1.HullService" in printed
    vertices = printed.partition('"vertices"')[2].partition("]")[0]
    assert "".join(vertices.split()).endswith("[0,0,4,0,4,4")
    if tool == "buf":
        assert '"sides": "AQD/"' in printed


def test_javascript(take_program: Callable[[str, str], Path], address: str) -> None:
    modules = ROOT / "tests/javascript/node_modules"
    assert modules.is_dir(), "run tests/peers.sh, which installs the npm packages"
    program = take_program("how-to/other-languages", "fleet.js")
    printed = run("node", str(program), address, folder=ROOT, NODE_PATH=str(modules)).splitlines()
    assert printed[0].startswith("0 snapshot ")
    assert [line for line in printed if line.startswith("acknowledged")] == ["acknowledged 1 1", "acknowledged 2 2"]
    assert any(line.startswith("2 change ") for line in printed)


def test_an_installation_has_the_proto_files() -> None:
    installed = files("dynhull_proto") / "dynhull" / "v1"
    names = {path.name for path in (ROOT / "proto/dynhull/v1").glob("*.proto")}
    assert {path.name for path in installed.iterdir()} == names
