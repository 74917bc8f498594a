"""The page about serving others: its certificates and its token, made and used as a reader would."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest
from blocks import blocks
from command_line import dynhull
from server_process import server_process


def test_certificates_and_a_token(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    certificates, (token, serve), (export, *calls) = (
        block.text.splitlines()
        for block in blocks((site / "how-to/serve/index.html").read_text())
        if re.match(r"openssl|dynhull token|export DYNHULL_TOKEN", block.text)
    )
    monkeypatch.chdir(tmp_path)
    for line in certificates:
        subprocess.run(line, shell=True, capture_output=True, check=True)
    made = dynhull(*shlex.split(token.partition(" >> ")[0])[1:])
    Path("tokens.toml").write_text(made.stdout)
    with server_process(*shlex.split(serve)[2:]) as server:
        assert server.address.startswith("0.0.0.0:")
        monkeypatch.setenv("DYNHULL_TOKEN", made.stderr.split()[-1])
        monkeypatch.setenv("DYNHULL_TLS_CA", export.rpartition("=")[2])
        for call in calls:
            done = dynhull(*shlex.split(call.replace("50051", server.address.rpartition(":")[2]))[1:])
            assert done.exit_code == 0, done.stderr
    assert done.stdout.startswith("serve/truck-1\t3\t3\t1\t")
