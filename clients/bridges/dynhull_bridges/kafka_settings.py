"""How to reach a Kafka that encrypts or asks who calls: a file with the usual settings of its clients."""

import ssl
from pathlib import Path
from typing import Any

PROTOCOLS = "PLAINTEXT", "SSL", "SASL_PLAINTEXT", "SASL_SSL"
MECHANISMS = "PLAIN", "SCRAM-SHA-256", "SCRAM-SHA-512"
NAMES = (
    "security.protocol",
    "sasl.mechanism",
    "sasl.username",
    "sasl.password",
    "ssl.ca.location",
    "ssl.certificate.location",
    "ssl.key.location",
    "ssl.key.password",
)


def read_settings(path: Path | None) -> dict[str, Any]:
    """What a client of aiokafka needs of a file with lines NAME=VALUE; nothing without a file.

    Raises:
        ValueError: a line is wrong: the message names file, line and setting, and never a value that may be a secret.
        OSError: there is no such file.
    """
    if path is None:
        return {}
    given: dict[str, str] = {}
    for number, line in enumerate(path.read_text("utf-8").splitlines(), start=1):
        name, equals, value = (each.strip() for each in line.partition("="))
        if not name or name.startswith("#"):
            continue
        if not equals or name not in NAMES:
            shown = name if equals else "no NAME=VALUE"
            raise ValueError(f"{path}:{number}: {shown}: there are {', '.join(NAMES)}")
        given[name] = value
    protocol = _one_of(path, given, "security.protocol", PROTOCOLS, "PLAINTEXT")
    found: dict[str, Any] = {"security_protocol": protocol}
    if protocol.startswith("SASL"):
        if missing := [each for each in ("sasl.username", "sasl.password") if not given.get(each)]:
            raise ValueError(f"{path}: {protocol} needs {missing[0]}")
        found["sasl_mechanism"] = _one_of(path, given, "sasl.mechanism", MECHANISMS, "PLAIN")
        found["sasl_plain_username"] = given["sasl.username"]
        found["sasl_plain_password"] = given["sasl.password"]
    elif unused := next((each for each in given if each.startswith("sasl.")), None):
        raise ValueError(f"{path}: {unused} needs security.protocol=SASL_SSL or SASL_PLAINTEXT")
    if protocol.endswith("SSL"):
        found["ssl_context"] = _context(path, given)
    elif unused := next((each for each in given if each.startswith("ssl.")), None):
        raise ValueError(f"{path}: {unused} needs security.protocol=SSL or SASL_SSL")
    return found


def _one_of(path: Path, given: dict[str, str], name: str, values: tuple[str, ...], usual: str) -> str:
    value = given.get(name, usual)
    if value not in values:
        raise ValueError(f"{path}: {name} is {value!r}, which is none of {', '.join(values)}")
    return value


def _context(path: Path, given: dict[str, str]) -> ssl.SSLContext:
    """The certificates."""
    try:
        context = ssl.create_default_context(cafile=given.get("ssl.ca.location"))
        if "ssl.certificate.location" in given:
            context.load_cert_chain(
                given["ssl.certificate.location"], given.get("ssl.key.location"), given.get("ssl.key.password", "")
            )
    except OSError as error:  # and SSLError, which is one
        raise ValueError(f"{path}: no certificates: {error.strerror or error}") from None
    return context
