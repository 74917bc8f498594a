"""Positions in the sentences of NMEA 0183, which GPS and AIS receivers write: those of GGA and RMC, of any talker."""

import re
from fractions import Fraction
from functools import reduce
from operator import xor

from .values import BadValueError

# Where a sentence says whether it has a fix, what it says there if not, and where its latitude is.
FIXES = {"GGA": (6, {"", "0"}, 2), "RMC": (2, {"", "V"}, 3)}
ADDRESS, KIND = 5, slice(2, 5)  # its characters: the talker, such as GP or GN, and the kind of sentence
# The digits of whole degrees, the greatest number of degrees, and the signs of the hemispheres.
AXES = {"latitude": (2, 90, {"N": 1, "S": -1}), "longitude": (3, 180, {"E": 1, "W": -1})}
TEXT = re.compile(r"[0-9]+(\.[0-9]*)?")
MINUTES = 60  # of a degree


def position(line: str) -> tuple[float, float] | None:
    """The longitude and the latitude of a sentence, each rounded once; None of one that has none, as of satellites.

    ValueError says what is wrong: no sentence, a checksum that is missing or another, no fix, or no place.
    """
    sentence = line.strip()
    if sentence.startswith("\\"):  # a block of tags, such as the time of the receiver
        sentence = sentence[1:].partition("\\")[2]
    if not sentence.startswith(("$", "!")):
        raise ValueError("not a sentence of NMEA: it does not begin with $")
    data, star, given = sentence[1:].partition("*")
    if not star:
        raise ValueError("the sentence has no checksum: is it cut?")
    expected = f"{reduce(xor, data.encode(), 0):02X}"
    if given.strip().upper() != expected:
        raise BadValueError("the checksum", f"and that of the sentence is {expected}", given)
    fields = data.split(",")
    kind = fields[0][KIND]
    if kind not in FIXES or len(fields[0]) != ADDRESS:
        return None
    at, without, first = FIXES[kind]
    if len(fields) < max(at, first + 3) + 1:
        raise ValueError(f"the sentence has {len(fields)} fields: {kind} has more")
    if fields[at] in without:
        raise ValueError("the receiver had no fix")
    latitude = _degrees("latitude", *fields[first : first + 2])
    return _degrees("longitude", *fields[first + 2 : first + 4]), latitude


def _degrees(name: str, text: str, hemisphere: str) -> float:
    """Degrees of a text of whole degrees and minutes, ddmm.mmmm."""
    digits, greatest, signs = AXES[name]
    minutes = text[digits:]
    if not TEXT.fullmatch(text) or len(text.partition(".")[0]) != digits + 2 or hemisphere not in signs:
        raise BadValueError(f"the {name}", "not degrees and minutes", f"{text},{hemisphere}")
    exact = int(text[:digits]) + Fraction(minutes) / MINUTES
    if Fraction(minutes) >= MINUTES or exact > greatest:
        raise BadValueError(f"the {name}", f"not up to {greatest} degrees and 60 minutes", f"{text},{hemisphere}")
    return signs[hemisphere] * float(exact) + 0.0
