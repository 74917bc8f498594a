"""The C library's memory."""

import ctypes

# <malloc.h> of glibc.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
# More than what a column of a segment is compressed in, over and over: for pages that are new each time the system
# takes longer than the compression.
LARGE_BLOCK = 2**22


def return_large_blocks() -> None:
    """Return blocks of four mebibytes and more to the system as soon as they are freed, and keep eight in a pool.

    By default glibc keeps blocks of up to 32 MiB for later, in a pool per thread. Hulls of earlier revisions are
    computed in several threads: the server held twice the memory that they took. With the first of the limits alone it
    would keep 128 KiB at the end of a pool, and return and fetch the rest again and again; twice is its own rule.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # another C library, which has its own ways
        return
    mallopt(M_MMAP_THRESHOLD, LARGE_BLOCK)
    mallopt(M_TRIM_THRESHOLD, 2 * LARGE_BLOCK)
