"""The files of certificates and keys that the settings name, examined before gRPC reads them.

gRPC reports only that it cannot listen or connect, whatever is wrong with them.
"""

import ssl
from contextlib import suppress
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
        _trust(context, client_ca, "--tls-client-ca")
        context.verify_mode = ssl.CERT_REQUIRED
    return context


def peer_context(ca: Path) -> ssl.SSLContext:
    """A context to connect to servers of the cluster, whose certificates --cluster-ca has signed. Raises ValueError."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    _trust(context, ca, "--cluster-ca")
    return context


def require_accepted(certificate: Path, key: Path, ca: Path, host: str) -> None:
    """Try a connection of another server of the cluster to this one, at this host, without a network.

    Raises:
        ValueError: the other server would refuse the certificate; or a file cannot be used.
    """
    asked, answered = ssl.MemoryBIO(), ssl.MemoryBIO()
    server = server_context(certificate, key, None).wrap_bio(asked, answered, server_side=True)
    peer = peer_context(ca).wrap_bio(answered, asked, server_hostname=host)
    try:
        while True:
            with suppress(ssl.SSLWantReadError):
                return peer.do_handshake()
            with suppress(ssl.SSLWantReadError):
                server.do_handshake()
    except ssl.SSLCertVerificationError as error:
        raise ValueError(
            f"--tls-cert {certificate}: other servers, which trust --cluster-ca {ca}, would not accept it at "
            f"--cluster-host {host}: {error.verify_message}"
        ) from None


def _trust(context: ssl.SSLContext, ca: Path, flag: str) -> None:
    _require(CERTIFICATE, ca, flag, "certificate", swapped="private key")
    try:
        context.load_verify_locations(ca)
    except ssl.SSLError as error:
        raise ValueError(f"{flag} {ca}: {_reason(error)}") from None


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
