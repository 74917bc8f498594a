"""HTTP: the status of an answer to a webhook. Without an answer a delivery is repeated."""

from http import HTTPStatus

from .table import Meaning, Refusals

SERVER_ERRORS = range(500, 1000)

HTTP = Refusals(
    {
        Meaning.PASSES: {
            HTTPStatus.REQUEST_TIMEOUT: "the request came too slowly",
            HTTPStatus.TOO_EARLY: "the receiver does not want it yet",
            HTTPStatus.TOO_MANY_REQUESTS: "too many requests",
            **dict.fromkeys(SERVER_ERRORS, "a fault of the receiver"),
        },
        Meaning.FINAL: {HTTPStatus.GONE: "the receiver wants nothing any more: deliveries to it end"},
    },
    otherwise=Meaning.FINAL,
)
