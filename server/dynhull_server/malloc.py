"""The C library's memory."""

import ctypes

# <malloc.h> of glibc.
M_MMAP_THRESHOLD = -3
LARGE_BLOCK = 2**20


def return_large_blocks() -> None:
    """Return blocks of a mebibyte and more to the system as soon as they are freed.

    By default glibc keeps blocks of up to 32 MiB for later, in a pool per thread. Hulls of earlier revisions are
    computed in several threads: the server held twice the memory that they took.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # another C library, which has its own ways
        return
    mallopt(M_MMAP_THRESHOLD, LARGE_BLOCK)
