"""What is said about a Kafka to deliver to: mistakes are named at the start, without secrets."""

import sys
from pathlib import Path

import pytest
from command_line import dynhull

from dynhull_bridges.kafka_settings import read_settings


def relay(tmp_path: Path, *options: object) -> str:
    common = ("--consumer", "test", "--state", tmp_path, "--address", "127.0.0.1:1")
    done = dynhull("relay", "alarm:a", *common, *options)
    assert done.exit_code == 2
    return done.stderr


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--to", "kafka:///t"], "has no host"),
        (["--to", "kafka://user:word@a/t"], "--to kafka://a/t: user and password are settings of --kafka-config"),
        (["--to", "kafka://a/{type}"], "--to has {type}, but all events of a source go to one topic"),
        (["--to", "kafka://a/b/c"], "'b/c' is no topic of Kafka: letters, digits, and ._-"),
        (["--to", "kafka://a/t?acks=1"], "kafka://a/t has no option 'acks' after the question mark"),
        (["--to", "kafka://a/t", "--batch", 2], "--batch is for webhooks"),
        (["--to", "events", "--kafka-config", __file__], "--kafka-config is for kafka://"),
    ],
)
def test_bad_options(options: list[object], complaint: str, tmp_path: Path) -> None:
    said = relay(tmp_path, *options)
    assert complaint in said
    assert "word@" not in said


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("security.protocol=TLS", "config: security.protocol is 'TLS', which is none of PLAINTEXT, SSL"),
        ("security.protocol=SASL_SSL", "config: SASL_SSL needs sasl.username"),
        ("# note\n\nsasl.pasword = s3cret", "config:3: sasl.pasword: there are security.protocol"),
        ("s3cret", "config:1: no NAME=VALUE: there are"),
        ("sasl.username=a\nsasl.password=s3cret", "config: sasl.username needs security.protocol=SASL_SSL"),
        ("ssl.ca.location=a", "config: ssl.ca.location needs security.protocol=SSL"),
        ("security.protocol=SSL\nssl.ca.location=/none", "config: no certificates: No such file"),
        (
            "security.protocol=SASL_PLAINTEXT\nsasl.username=a\nsasl.password=s3cret\nsasl.mechanism=OAUTHBEARER",
            "config: sasl.mechanism is 'OAUTHBEARER', which is none of PLAIN",
        ),
    ],
)
def test_bad_settings(text: str, complaint: str, tmp_path: Path) -> None:
    file = tmp_path / "config"
    file.write_text(text)
    said = relay(tmp_path, "--to", "kafka://a/t", "--kafka-config", file)
    assert f"{tmp_path}/{complaint}" in said
    assert "s3cret" not in said.replace(str(tmp_path), "")


@pytest.mark.parametrize(
    ("url", "text", "complaint"),
    [
        ("kafka://user:word@a/t", "", "kafka://a/t: user and password are settings of --kafka-config"),
        ("kafka://a/t", "s3cret", "config:1: no NAME=VALUE: there are security.protocol"),
        ("nats://a/t", "", "--kafka-config is for kafka://"),
    ],
)
def test_an_ingest_has_the_same_settings(url: str, text: str, complaint: str, tmp_path: Path) -> None:
    file = tmp_path / "config"
    file.write_text(text)
    done = dynhull("ingest", url, "--hull", "h", "--key", "$.id", "--address", "127.0.0.1:1", "--kafka-config", file)
    assert done.exit_code == 2
    assert complaint in done.stderr
    assert "s3cret" not in done.stderr.replace(str(tmp_path), "")
    assert "word@" not in done.stderr


def test_settings(tmp_path: Path) -> None:
    file = tmp_path / "config"
    lines = ("security.protocol=SASL_PLAINTEXT", "sasl.mechanism=SCRAM-SHA-512", "sasl.username=a", "sasl.password=b=c")
    file.write_text("\n".join(lines))
    assert read_settings(file) == {
        "security_protocol": "SASL_PLAINTEXT",
        "sasl_mechanism": "SCRAM-SHA-512",
        "sasl_plain_username": "a",
        "sasl_plain_password": "b=c",
    }
    assert read_settings(None) == {}


def test_without_its_client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in [each for each in sys.modules if each == "dynhull_bridges.kafka" or each.split(".")[0] == "aiokafka"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "aiokafka", None)
    said = relay(tmp_path, "--to", "kafka://a/t")
    assert "error: dynhull relay needs aiokafka, which is not installed" in said
    assert "pip install 'dynhull[relay,kafka]'" in said
