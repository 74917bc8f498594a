"""The failure of a program that checks what a server promises."""


class BrokenPromiseError(AssertionError):
    """The server did what it says it never does."""


def require(condition: object, what: str) -> None:
    if not condition:
        raise BrokenPromiseError(what)
