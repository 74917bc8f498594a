"""Places that are none, too far, or odd and right, for every entry to hulls on the globe about (0, 0)."""

import math

LATITUDE = r"a latitude (must be|is) from -90 to 90 degrees"
FIRST = LATITUDE + r"; (the )?longitude comes first"
LONGITUDE = r"a longitude (must be|is) from -360 to 360 degrees"
FINITE = r"finite"

# Pairs that are no places, and the words that refuse them.
NO_PLACES = [
    ((120, 91), LATITUDE),
    ((120, -90.00000000000001), LATITUDE + "$"),
    ((52.5, 113.4), FIRST),  # latitude and longitude, swapped
    ((-33.9, 151.2), FIRST),
    ((361, 0), LONGITUDE),
    ((540, 0), LONGITUDE),
    ((-360.00000000000006, 0), LONGITUDE),
    ((540, 91), LATITUDE),
    ((math.nan, 0), FINITE),
    ((0, math.nan), FINITE),
    ((math.inf, 0), FINITE),
    ((0, -math.inf), FINITE),
]

# Places that are too far from (0, 0), and how far.
TOO_FAR = [
    ((180, 0), "180.000000"),  # the antipode
    ((-180, 0), "180.000000"),
    ((181, 0), "179.000000"),
    ((540 - 360, -0.0), "180.000000"),
    ((0, 90), "90.000000"),
    ((123, -90), "90.000000"),
    ((85.00000001, 0), "85.000000"),
    ((0, -85.00000001), "85.000000"),
]

# Odd ways to write places within reach, and what comes back.
TAKEN = [
    ((-0.0, -0.0), (0.0, 0.0)),
    ((360, 1), (360, 1)),
    ((-360, 1), (-360, 1)),
    ((275, 0), (275, 0)),  # 85 degrees to the west
    ((85, 0), (85, 0)),
    ((-85, 0), (-85, 0)),
    ((0, 85), (0, 85)),
    ((5e-324, -5e-324), (5e-324, -5e-324)),
]
