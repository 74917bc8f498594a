"""Settings from flags, environment and file; the log."""

import json
import subprocess
from pathlib import Path

import pytest
from command_line import dynhull
from forked import COMMAND, Process
from server_process import PATIENCE, server_process

from dynhull_client import HullClient, LimitExceededError


def shown(*arguments: str) -> dict[str, tuple[str, str]]:
    """The settings and their origins, as `dynhull config` shows them."""
    result = dynhull("config", *arguments)
    assert (result.exit_code, result.stderr) == (0, "")
    settings = {}
    for line in result.stdout.splitlines():
        setting, _, origin = line.rpartition("#")
        name, _, value = setting.strip("# ").partition("=")
        settings[name.strip()] = value.strip(), origin.strip()
    return settings


def test_a_flag_goes_before_the_environment_and_that_before_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "dynhull.toml"
    file.write_text('port = 1\nmax_hulls = 1\nmax_points = 1\nlog_format = "json"\n')
    monkeypatch.setenv("DYNHULL_PORT", "2")
    monkeypatch.setenv("DYNHULL_MAX_HULLS", "2")
    settings = shown("--config", str(file), "--port", "3")
    assert settings["port"] == ("3", "flag")
    assert settings["max_hulls"] == ("2", "DYNHULL_MAX_HULLS")
    assert settings["max_points"] == ("1", str(file))
    assert settings["log_format"] == ('"json"', str(file))
    assert settings["host"] == ('"127.0.0.1"', "default")
    assert settings["tokens"] == ("", "default")


def test_what_config_shows_is_a_file_for_config(tmp_path: Path) -> None:
    file = tmp_path / "dynhull.toml"
    file.write_text(dynhull("config", "--max-hulls", "7", "--create-on-write").stdout)
    settings = shown("--config", str(file))
    assert settings["max_hulls"] == ("7", str(file))
    assert settings["create_on_write"] == ("true", str(file))


def test_a_setting_of_several_values_comes_from_everywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "dynhull.toml"
    file.write_text('metrics_prefix = ["fleet/"]\n')
    assert shown()["metrics_prefix"] == ("[]", "default")
    assert shown("--config", str(file))["metrics_prefix"] == ('["fleet/"]', str(file))
    monkeypatch.setenv("DYNHULL_METRICS_PREFIX", "fleet/, tram/")
    assert shown("--config", str(file))["metrics_prefix"] == ('["fleet/", "tram/"]', "DYNHULL_METRICS_PREFIX")
    flags = ("--metrics-prefix", "a/", "--metrics-prefix", "")
    assert shown("--config", str(file), *flags)["metrics_prefix"] == ('["a/", ""]', "flag")


def test_former_names_of_settings_are_accepted_with_a_line_that_says_the_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "dynhull.toml"
    file.write_text("history_bytes = 1\n")
    monkeypatch.setenv("DYNHULL_FENCE_HISTORY_BYTES", "2")
    result = dynhull("config", "--config", str(file))
    assert result.stderr.splitlines() == [
        "warning: DYNHULL_FENCE_HISTORY_BYTES is called --fence-event-bytes now, and means the same",
        f"warning: {file}: history_bytes is called --resume-bytes now, and means the same",
    ]
    lines = [" ".join(line.split()) for line in result.stdout.splitlines()]
    assert f"resume_bytes = 1 # {file}" in lines
    assert "fence_event_bytes = 2 # DYNHULL_FENCE_HISTORY_BYTES" in lines
    assert "history_bytes = 1" not in result.stdout

    result = dynhull("config", "--config", str(file), "--history-bytes", "3", "--fence-event-bytes", "4")
    assert "--history-bytes is called --resume-bytes now" in result.stderr
    lines = [" ".join(line.split()) for line in result.stdout.splitlines()]
    assert {"resume_bytes = 3 # flag", "fence_event_bytes = 4 # flag"} <= set(lines)
    assert "--history-bytes" not in dynhull("serve", "--help").stdout.replace("--max-history-bytes", "")

    both = dynhull("config", "--history-bytes", "3", "--resume-bytes", "4")
    assert (both.exit_code, both.stderr) == (
        2,
        "error: history_bytes is the former name of resume_bytes: leave it out\n",
    )


def test_links_of_kubernetes_to_services_are_no_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DYNHULL_PORT", "tcp://10.96.0.12:50051")
    monkeypatch.setenv("DYNHULL_PORT_50051_TCP", "tcp://10.96.0.12:50051")
    monkeypatch.setenv("DYNHULL_METRICS_PORT", "udp://10.96.0.13:9000")  # of a Service dynhull-metrics
    settings = shown()
    assert settings["port"] == ("50051", "default")
    assert settings["metrics_port"] == ("", "default")
    command = [COMMAND, "serve", "--port", "0", "--in-memory"]
    with Process(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline().startswith("dynhull serving on")
        process.terminate()
        assert process.wait(PATIENCE) == 0
        first, second, third, *_ = process.stderr
    assert "DYNHULL_PORT is ignored" in first
    assert "10.96.0.12" in first
    assert "DYNHULL_METRICS_PORT is ignored" in second
    assert "serving" in third


def test_the_server_uses_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "dynhull.toml"
    file.write_text("max_hulls = 1\n")
    monkeypatch.setenv("DYNHULL_CREATE_ON_WRITE", "true")
    with server_process("--config", str(file)) as server, HullClient(server.address) as client:
        client.apply("a", insert=[[1, 2]])
        with pytest.raises(LimitExceededError):
            client.apply("b", insert=[[1, 2]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("port = 70000", "port = 70000: Input should be less than or equal to 65535"),
        ("prot = 1", "prot: there is no such setting; did you mean port?"),
        ('max_hulls = "many"', "max_hulls = 'many': Input should be a valid integer"),
        ("port 1", "settings.toml"),
        ('metrics_prefix = ["fleet/*"]', "no name begins with 'fleet/*': names consist of letters"),
    ],
)
def test_a_wrong_file_is_explained(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "settings.toml"
    file.write_text(text)
    result = dynhull("config", "--config", str(file))
    assert result.exit_code == 2
    assert message in result.stderr
    assert "Traceback" not in result.stderr


def test_help_shows_every_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    helped = dynhull("serve", "--help").stdout
    for name in shown():
        assert f"--{name.replace('_', '-')}" in helped


def test_the_log_is_json_where_told() -> None:
    command = [COMMAND, "serve", "--port", "0", "--in-memory", "--log-format", "json"]
    with Process(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        address = process.stdout.readline().split()[-1]
        process.terminate()
        assert process.wait(PATIENCE) == 0
        lines = [json.loads(line) for line in process.stderr]
    assert [line["event"] for line in lines] == ["serving", "draining", "stopped"]
    assert lines[0]["address"] == address
    assert {"level", "logger", "timestamp"} <= set(lines[0])
