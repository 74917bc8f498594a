"""The format of events, in arrays and as stored, for Python and C++: the build makes a header of this file.

Therefore it imports nothing, and has integers, and fields with types of numpy.
"""

# The keys of a run: none, strings, or integers of 8 bytes, little-endian.
NO_KEY, STRING_KEY, INTEGER_KEY = 0, 1, 2
INTEGER_BYTES = 8
# Consecutive events of one fence and one moment. `hull`: the place of the name of the subjects' hull; `kind`: whether
# the events have keys, and which; the revisions and the time: as in `FenceEvent`.
RUN_FIELDS = [
    ("fence", "int64"),
    ("first", "int64"),
    ("count", "int64"),
    ("hull", "int64"),
    ("kind", "uint8"),
    ("subject_revision", "int64"),
    ("area_revision", "int64"),
    ("time", "int64"),
]
# `length`: the bytes of the key; the position, that before and the distance are NaN where there is none.
EVENT_FIELDS = [
    ("type", "uint8"),
    ("causes", "uint8"),
    ("length", "uint8"),
    ("x", "float64"),
    ("y", "float64"),
    ("before_x", "float64"),
    ("before_y", "float64"),
    ("distance", "float64"),
    ("event_time", "int64"),
    ("first_time", "int64"),
]


class Mark:
    """The lower bits of a byte: the type of an event; the others: what it has. A distance without bytes is 0."""

    TYPE = 15
    HAS_POSITION, HAS_PREVIOUS, HAS_DISTANCE, HAS_EVENT_TIME = 16, 32, 64, 128


class BlockFlag:
    """What a row of many events has; and how it is written, since format 8.

    ONE_EACH: without the counts of runs, as each is one event; NO_AREAS: without revisions of areas, as there are none;
    DECIMALS: positions as multiples of 1e-7.
    """

    HAS_HULLS, HAS_EVENT_TIMES, HAS_FIRST_TIMES, HAS_INSIDE, HAS_ORIGINS = 1, 2, 4, 8, 16
    ONE_EACH, NO_AREAS, DECIMALS = 32, 64, 128


class LoneFlag:
    """What an event that is alone has beside what its mark says, and how it is written. Without causes it is a move."""

    HAS_HULL, HAS_AREA, HAS_FIRST_TIME, HAS_CAUSES, HAS_MORE = 1, 2, 4, 8, 16
    DECIMALS, STRING_KEY, INTEGER_KEY = 32, 64, 128


# Coordinates are integers as multiples of 1 / PLACES up to this one, which a double holds.
PLACES, GREATEST = 10**7, 2**53
# Microseconds since 1970 at the beginning of 2030: times within nine years of it take seven bytes.
NEAR = 1_893_456_000_000_000
