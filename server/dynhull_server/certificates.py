"""The files of --tls-cert, --tls-key and --tls-client-ca, examined before gRPC reads them.

gRPC reports only that it cannot listen, whatever is wrong with them.
"""

import ssl
from pathlib import Path

CERTIFICATE = b"-----BEGIN CERTIFICATE-----"
KEY = b"PRIVATE KEY-----"


def server_context(certificate: Path, key: Path, client_ca: Path | None) -> ssl.SSLContext:
    """A context with the certificate and its key; with `client_ca`, clients must present a certificate too.

    Raises:
        ValueError: a file cannot be read, has no certificate or no key, or the key is not that of the certificate.
    """
    _require(CERTIFICATE, certificate, "--tls-cert", "certificate", swapped="private key of --tls-key")
    _require(KEY, key, "--tls-key", "private key", swapped="certificate of --tls-cert")
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)

    def no_password() -> str:
        raise ValueError(f"--tls-key {key}: the key is encrypted: decrypt it, the server has no password")

    try:
        context.load_cert_chain(certificate, key, no_password)
    except ssl.SSLError as error:
        raise ValueError(f"--tls-cert {certificate} and --tls-key {key} do not fit: {_reason(error)}") from None
    if client_ca is not None:
        _require(CERTIFICATE, client_ca, "--tls-client-ca", "certificate", swapped="private key")
        try:
            context.load_verify_locations(client_ca)
        except ssl.SSLError as error:
            raise ValueError(f"--tls-client-ca {client_ca}: {_reason(error)}") from None
        context.verify_mode = ssl.CERT_REQUIRED
    return context


def _require(mark: bytes, path: Path, flag: str, what: str, *, swapped: str) -> None:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ValueError(f"{flag} {path}: {error.strerror}") from None
    if mark in content:
        return
    other = CERTIFICATE if mark == KEY else KEY
    hint = f"; is it the {swapped}?" if other in content else ""
    raise ValueError(f"{flag} {path}: the file has no {what} in PEM format{hint}")


def _reason(error: ssl.SSLError) -> str:
    return (error.reason or str(error)).replace("_", " ").lower()
