"""The files of --tls-ca, --client-cert and --client-key, examined before gRPC reads them.

gRPC reports only that no connection could be made, whatever is wrong with them.
"""

import ssl
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import grpc


def credentials(
    tls: bool, ca: Path | None, certificate: Path | None, key: Path | None
) -> "grpc.ChannelCredentials | None":
    """What gRPC needs to encrypt; None for no encryption.

    Raises:
        ValueError: a file has no certificate or no key in PEM format, or only one of certificate and key is given.
    """
    if (certificate is None) != (key is None):
        raise ValueError("--client-cert and --client-key must be given together")
    if not (tls or ca or certificate):
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    if ca is not None:
        try:
            context.load_verify_locations(ca)
        except ssl.SSLError:
            raise ValueError(f"--tls-ca {ca}: the file has no certificates in PEM format") from None
    if certificate is not None and key is not None:
        _examine_pair(context, certificate, key)
    import grpc

    return grpc.ssl_channel_credentials(
        *(None if path is None else path.read_bytes() for path in (ca, key, certificate))
    )


def _examine_pair(context: ssl.SSLContext, certificate: Path, key: Path) -> None:
    def no_password() -> str:
        raise ValueError(f"--client-key {key}: the key is encrypted: decrypt it first")

    try:
        context.load_cert_chain(certificate, key, no_password)
    except ssl.SSLError:
        raise ValueError(
            f"--client-cert {certificate} and --client-key {key}: not a certificate and its private key in PEM format"
        ) from None
