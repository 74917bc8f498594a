"""NATS: codes of JetStream's errors (nats-server, errors.json), and words of the server's -ERR, which has no codes."""

from nats.js.errors import APIError

from .table import Meaning, Refusals

NATS = Refusals(
    {
        Meaning.PASSES: {
            10002: "resource limits exceeded for account",
            10004: "incomplete results",
            10005: "no suitable peers for placement",
            10007: "JetStream cluster not assigned to this server",
            10008: "JetStream system temporarily unavailable: a leader is elected",
            10009: "JetStream cluster can not handle request: not the leader",
            10012: "the consumer could not be created",
            10014: "consumer not found: it is made anew",
            10023: "insufficient resources",
            10026: "maximum consumers limit reached",
            10027: "maximum number of streams reached",
            10028: "insufficient memory resources available",
            10041: "error of RAFT",
            10047: "insufficient storage resources available",
            10077: "the stream could not store the message: it is full, for example",
            10118: "stream is offline",
            10119: "consumer is offline",
            "authentication timeout": "the server was too slow",
            "maximum connections exceeded": "too many connections",
            "maximum account active connections exceeded": "too many connections",
            "stale connection": "the connection is lost",
        },
        Meaning.DOUBTFUL: {
            10035: "account not found",
            10039: "JetStream not enabled for account",
            10059: "stream not found",
            10076: "JetStream not enabled",
        },
        Meaning.FINAL: {
            10003: "bad request",
            10025: "invalid JSON",
            10054: "message size exceeds maximum allowed",
            10060: "expected stream does not match",
            10093: "the stream stores nothing of the subject",
            10109: "invalid operation on sealed stream",
            "account authentication expired": "credentials that have expired",
            "authorization violation": "bad credentials",
            "secure connection - tls required": "no encryption: tls:// has it",
            "user authentication expired": "credentials that have expired",
            "user authentication revoked": "credentials that were taken away",
        },
    },
    otherwise=Meaning.PASSES,
)
WORDS = [code for codes in NATS.rows.values() for code in codes if isinstance(code, str)]


def code_of(error: BaseException) -> int | str | None:
    """The code of an error of the client; None if it has none, as a connection that is lost."""
    if isinstance(error, APIError):
        return error.err_code
    text = str(error).lower()
    return next((each for each in WORDS if each in text), None)
