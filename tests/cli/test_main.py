"""The `dynhull` command and the commands it finds."""

import subprocess
import sys
from pathlib import Path

import pytest
from server_process import COMMAND, PATIENCE

WITHOUT = """
import sys
sys.modules[{module!r}] = None
sys.argv = ["dynhull", *{arguments!r}]
from dynhull_cli.main import main
main()
"""


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)


def run_without(module: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `dynhull` as if a module were not installed."""
    return run(sys.executable, "-c", WITHOUT.format(module=module, arguments=arguments))


def test_help_lists_the_commands() -> None:
    result = run(COMMAND, "--help")
    assert result.returncode == 0
    assert "serve" in result.stdout
    assert "Serve hulls over gRPC." in result.stdout


def test_an_unknown_command() -> None:
    result = run(COMMAND, "dance")
    assert result.returncode == 2
    assert "dance" in result.stderr


@pytest.mark.parametrize("arguments", [("serve",), ("serve", "--port", "0")])
def test_a_missing_extra_says_how_to_install_it(arguments: tuple[str, ...]) -> None:
    result = run_without("grpc", *arguments)
    assert result.returncode == 1
    assert "pip install 'dynhull[server]'" in result.stderr
    assert "Traceback" not in result.stderr


def test_something_missing_that_is_loaded_late() -> None:
    result = run_without("pandas", "demo")
    assert result.returncode == 1
    assert "dynhull demo needs pandas" in result.stderr
    assert "pip install 'dynhull[demo]'" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_format_that_is_not_installed(tmp_path: Path) -> None:
    file = tmp_path / "points.geojson"
    file.write_text("{}")
    result = run_without("ijson", "load", "a", str(file))
    assert result.returncode == 1
    assert "dynhull load needs ijson" in result.stderr
    assert "pip install 'dynhull[client,cli,files]'" in result.stderr


def test_help_works_without_the_extra() -> None:
    result = run_without("grpc", "--help")
    assert result.returncode == 0
    assert "Serve hulls over gRPC." in result.stdout
    assert 'needs the extra "server"' in run_without("grpc", "serve", "--help").stdout


def test_without_a_command_line() -> None:
    result = run_without("typer", "serve")
    assert result.returncode == 1
    assert "pip install 'dynhull[cli]'" in result.stderr
