"""Events of fences in C++, with the same results as in Python."""



def numbered(waiting: list[tuple[object, ...]], types: bytes, places: dict[int, int], lasts: object, times: object) -> tuple[bytes, bytes, bytes]:
    """
    The events of crossings: the bytes of their runs, of themselves, and of what they say of their fences.
    """

def encoded(runs: object, rows: object, keys: bytes, own: object, names: tuple[str, ...], more: int) -> bytes:
    """
    Events as the bytes that are stored, without those of members and origins, whose flags are `more`.
    """
