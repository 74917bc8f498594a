"""What `dynhull serve` cannot use is named with its setting, before gRPC sees it, and ends it with exit code 2."""

import resource
import socket
from pathlib import Path

import pytest
import trustme
from cryptography.hazmat.primitives import serialization
from server_process import run, server_process

SERVE = ("serve", "--in-memory", "--port", "0", "--log-level", "error")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    for name in ("", "other-"):
        issued = trustme.CA().issue_cert("localhost")
        issued.cert_chain_pems[0].write_to_path(folder / f"{name}cert.pem")
        issued.private_key_pem.write_to_path(folder / f"{name}key.pem")
    (folder / "points.csv").write_text("x,y\n1,2\n")
    (folder / "broken.pem").write_text("-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n")
    key = serialization.load_pem_private_key((folder / "key.pem").read_bytes(), None)
    password = serialization.BestAvailableEncryption(b"secret")
    (folder / "locked.pem").write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, password)
    )
    return folder


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--tls-cert no.pem --tls-key key.pem", "--tls-cert no.pem: No such file or directory"),
        (
            "--tls-cert key.pem --tls-key cert.pem",
            "--tls-cert key.pem: the file has no certificate in PEM format; is it the private key of --tls-key?",
        ),
        ("--tls-cert points.csv --tls-key key.pem", "--tls-cert points.csv: the file has no certificate"),
        ("--tls-cert cert.pem --tls-key locked.pem", "--tls-key locked.pem: the key is encrypted"),
        ("--tls-cert cert.pem --tls-key other-key.pem", "--tls-cert cert.pem and --tls-key other-key.pem do not fit: "),
        (
            "--tls-cert cert.pem --tls-key key.pem --tls-client-ca points.csv",
            "--tls-client-ca points.csv: the file has no certificate",
        ),
        ("--tls-cert cert.pem --tls-key key.pem --tls-client-ca broken.pem", "--tls-client-ca broken.pem: "),
        ("--tokens no.toml", "--tokens no.toml: No such file or directory"),
        ("--config no.toml", "--config no.toml: No such file or directory"),
        ("--host no.invalid --insecure", "cannot listen on no.invalid:0: "),
    ],
)
def test_a_file_that_is_unusable(files: Path, monkeypatch: pytest.MonkeyPatch, options: str, words: str) -> None:
    monkeypatch.chdir(files)
    refused = run(*SERVE, *options.split())
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()  # and none of gRPC's
    assert words in line


def test_a_file_without_tokens_is_warned_about(files: Path) -> None:
    (files / "none.toml").write_text("")
    with server_process("--tokens", str(files / "none.toml"), complaints="has none: every call is refused"):
        pass


def test_data_in_a_file(files: Path) -> None:
    refused = run("serve", "--port", "0", "--data", str(files / "points.csv"))
    assert refused.returncode == 2
    assert "points.csv is a file, not a data folder" in refused.stderr


def test_a_port_in_use_is_called_that() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        for option in ("--port", "--metrics-port"):
            refused = run(*SERVE, "--log-level", "info", option, str(port))
            assert refused.returncode == 2
            (line,) = refused.stderr.splitlines()
            assert f"cannot listen on 127.0.0.1:{port}" in line
            assert "another program uses this port" in line


def test_more_connections_than_open_files() -> None:
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    with server_process("--max-connections", str(hard), complaints=f"the limit on open files, {hard}"):
        pass
    with server_process("--max-connections", str(hard - 1)) as server:
        assert resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE) == (hard, hard)
