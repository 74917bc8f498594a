"""The `dynhull` command and the commands it finds."""

import json
import os
import subprocess
import sys
from importlib.metadata import entry_points, version
from pathlib import Path

import pytest
from cases import slow
from command_line import dynhull
from forked import COMMAND
from patience import PATIENCE

IMPORTED = """
import sys
sys.argv = ["dynhull", *{arguments!r}]
from dynhull_cli.main import main
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""
# Completes or shows the help of one command after the other, and returns the packages imported by then.
ASKED = """
import io, json, os, sys
from contextlib import redirect_stdout, suppress
from dynhull_cli.commands import app
found = []
for command in {commands!r}:
    words = ["dynhull", *command, {asked!r}]
    sys.argv = words
    if {asked!r} == "--":
        os.environ |= {{
            "_DYNHULL_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)
        }}
    with redirect_stdout(io.StringIO()) as output, suppress(SystemExit):
        app(prog_name="dynhull")
    found.append((output.getvalue(), [*{{module.partition(".")[0] for module in sys.modules}}]))
print(json.dumps(found))
"""
OURS = {
    "dynhull_bridges",
    "dynhull_cli",
    "dynhull_cluster",
    "dynhull_gateway",
    "dynhull_server",
    "dynhull_surface",
}
MODELS = {
    "annotated_types",
    "pydantic",
    "pydantic_core",
    "typing_extensions",
    "typing_inspection",
}  # which typer uses too
FRAMES = {"attr", "markdown_it", "mdurl", "pygments", "rich"}  # around the help of a command
SLOW = {"asyncio", "multiprocessing", "sqlite3"}  # of the standard library
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


@pytest.mark.parametrize(
    ("arguments", "environment"),
    [
        (["--help"], {}),
        (["--version"], {}),
        ([], {}),
        ([], {"_DYNHULL_COMPLETE": "complete_bash", "COMP_WORDS": "dynhull ", "COMP_CWORD": "1"}),
    ],
)
def test_the_list_of_commands_imports_none(arguments, environment) -> None:
    command = [sys.executable, "-c", IMPORTED.format(arguments=arguments)]
    done = subprocess.run(
        command, env={**os.environ, **environment}, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == (0 if arguments or environment else 2), done.stderr
    assert set(done.stderr.split()) & {"numpy", "grpc", *FRAMES} == set()


@pytest.mark.parametrize(
    ("asked", "answer"), [("--", "--help"), pytest.param("--help", "Usage: ", marks=slow)], ids=["completion", "help"]
)
def test_the_options_of_a_command_are_known_without_what_it_runs(asked, answer) -> None:
    commands = [[], *([entry.name] for entry in entry_points(group="dynhull.commands"))]
    done = run(sys.executable, "-c", ASKED.format(asked=asked, commands=commands))
    assert done.returncode == 0, done.stderr
    (_, for_dynhull), *for_each = json.loads(done.stdout)
    for [name], (output, imported) in zip(commands[1:], for_each, strict=True):
        assert answer in output, name
        # Private modules belong to a package that is found, or to the standard library (_sysconfigdata__linux...).
        third_party = {each for each in imported if not each.startswith("_")} - sys.stdlib_module_names
        early = (third_party | SLOW.intersection(imported)) - {*for_dynhull, *OURS, *MODELS, *FRAMES}
        assert not early, f"dynhull {name} {asked} imports {', '.join(sorted(early))}"


def test_the_help_of_each_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every example has a line of its own."""
    monkeypatch.setenv("COLUMNS", "120")
    listed, examples = dynhull("--help").stdout, 0
    for entry in entry_points(group="dynhull.commands"):
        done = dynhull(entry.name, "-h")
        assert (done.exit_code, f" dynhull {entry.name} " in done.stdout.replace(" root ", " dynhull ")) == (0, True)
        assert f"\n  {entry.name} " in listed
        assert "<bool>" not in done.stdout, "a flag takes no value"
        shown = [line.strip() for line in done.stdout.splitlines()]
        for line in (entry.load().__doc__ or "").splitlines():
            if line.startswith(" " * 8 + "dynhull "):
                assert line.strip() in shown, entry.name
                examples += 1
    assert examples > 20
    assert "More:" not in listed, "each command has its group"
    assert "Another name for dynhull load." in dynhull("import", "-h").stdout


def test_the_version() -> None:
    assert dynhull("--version").stdout == f"dynhull {version('dynhull')}\n"


def test_an_unknown_command() -> None:
    result = run(COMMAND, "dance")
    assert result.returncode == 2
    assert "dance" in result.stderr


@pytest.mark.parametrize("arguments", [("serve",), ("serve", "--port", "0")])
def test_a_missing_extra_says_how_to_install_it(arguments: tuple[str, ...]) -> None:
    result = run_without("grpc", *arguments)
    assert result.returncode == 2
    assert "pip install 'dynhull[server]'" in result.stderr
    assert "Traceback" not in result.stderr


@slow
def test_something_missing_that_is_loaded_late() -> None:
    result = run_without("pandas", "demo")
    assert result.returncode == 2
    assert "dynhull demo needs pandas" in result.stderr
    assert "pip install 'dynhull[demo]'" in result.stderr
    assert "Traceback" not in result.stderr


@slow
def test_a_format_that_is_not_installed(tmp_path: Path) -> None:
    file = tmp_path / "points.geojson"
    file.write_text("{}")
    result = run_without("ijson", "load", "a", str(file))
    assert result.returncode == 2
    assert "dynhull load needs ijson" in result.stderr
    assert "pip install 'dynhull[client,cli,files]'" in result.stderr


@slow
def test_help_works_without_the_extra() -> None:
    result = run_without("grpc", "--help")
    assert result.returncode == 0
    assert "Serve hulls over gRPC." in result.stdout
    assert "--port" in run_without("grpc", "serve", "--help").stdout
    # Where the options themselves need what is missing.
    assert 'needs the extra "server"' in run_without("dynhull_server.flags", "serve", "--help").stdout


def test_a_name_that_is_nearly_a_command() -> None:
    done = dynhull("lsit")
    assert done.exit_code == 2
    assert "No such command 'lsit'. Did you mean 'list'?" in done.stderr
    assert "Did you mean" not in dynhull("xyzzy").stderr


def test_an_option_of_a_command_before_its_name() -> None:
    done = dynhull("--address", "127.0.0.1:1", "list")
    assert done.exit_code == 2
    told = " ".join(done.stderr.replace("│", " ").split())
    assert "Options of a command come after its name: dynhull list --address" in told
    assert "come after" not in dynhull("list", "--frob").stderr


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["create", "k", "--keyed", "float"], "Invalid value for '--keyed': 'float' is not one of 'str', 'int'."),
        (["frontier", "k", "--rate", "high"], "Invalid value for '--rate': 'high'. Input should be"),
        (["serve", "--port", "high"], "Invalid value for '--port': 'high'. Input should be"),
    ],
)
def test_a_value_of_the_wrong_kind_is_shown(command: list[str], message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    done = dynhull(*command)
    assert done.exit_code == 2
    assert message in done.stderr


def test_without_a_command_line() -> None:
    result = run_without("typer", "serve")
    assert result.returncode == 2
    assert "pip install 'dynhull[cli]'" in result.stderr
