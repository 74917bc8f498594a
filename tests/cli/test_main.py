"""The `dynhull` command and the commands it finds."""

import os
import subprocess
import sys
from importlib.metadata import entry_points, version
from pathlib import Path

import pytest
from command_line import dynhull
from server_process import COMMAND, PATIENCE

IMPORTED = """
import sys
sys.argv = ["dynhull", *{arguments!r}]
from dynhull_cli.main import main
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""
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


def imported(*arguments: str, **environment: str) -> set[str]:
    """The modules that `dynhull` imports on the way."""
    command = [sys.executable, "-c", IMPORTED.format(arguments=arguments)]
    done = subprocess.run(
        command, env={**os.environ, **environment}, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


@pytest.mark.parametrize(
    ("arguments", "environment", "heavy"),
    [
        (["--help"], {}, {"numpy", "grpc"}),
        (["--version"], {}, {"numpy", "grpc"}),
        ([], {"_DYNHULL_COMPLETE": "complete_bash", "COMP_WORDS": "dynhull ", "COMP_CWORD": "1"}, {"numpy", "grpc"}),
        (["list", "-h"], {}, {"numpy", "grpc"}),
        (["load", "-h"], {}, {"grpc", "pyarrow", "ijson"}),
        (["query", "-h"], {}, {"grpc"}),
        (["demo", "-h"], {}, {"pandas", "pyproj", "matplotlib"}),
        (["dashboard", "-h"], {}, {"bokeh"}),
    ],
)
def test_help_and_completion_import_only_what_they_show(arguments, environment, heavy) -> None:
    assert imported(*arguments, **environment) & heavy == set()


def test_the_help_of_each_command() -> None:
    listed = dynhull("--help").stdout
    for entry in entry_points(group="dynhull.commands"):
        done = dynhull(entry.name, "-h")
        assert (done.exit_code, f" dynhull {entry.name} " in done.stdout.replace(" root ", " dynhull ")) == (0, True)
        assert f"│ {entry.name} " in listed


def test_the_version() -> None:
    assert dynhull("--version").stdout == f"dynhull {version('dynhull')}\n"


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
