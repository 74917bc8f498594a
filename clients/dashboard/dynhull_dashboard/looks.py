"""Colours, line styles and markers that distinguish the hulls on a page, with or without colour vision."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Look:
    """A colour, the dashes of its lines in pixels (none for a solid line), and the marker of its vertices, if any."""

    colour: str
    dash: tuple[int, ...]
    marker: str = ""


# Okabe and Ito, "Color Universal Design" (2002), ordered by contrast with both white and black.
LOOKS = (
    Look("#0072B2", (), "circle"),
    Look("#D55E00", (8, 3), "square"),
    Look("#009E73", (2, 3), "triangle"),
    Look("#CC79A7", (10, 3, 2, 3), "diamond"),
    Look("#E69F00", (14, 4), "inverted_triangle"),
    Look("#56B4E9", (5, 2, 5, 6), "hex"),
    # Colours come again with another line and another marker.
    Look("#0072B2", (2, 2), "diamond"),
    Look("#D55E00", (16, 3, 2, 3), "hex"),
    Look("#009E73", (6, 2), "inverted_triangle"),
    Look("#CC79A7", (3, 6), "square"),
)

# On the dark page those whose contrast with it is below 4.5:1 are lighter.
ON_DARK = {"#0072B2": "#3D9BE0", "#D55E00": "#EE7A2E", "#009E73": "#1FB98A", "#9b5de5": "#BB8CFF", "#7d8590": "#9AA5B1"}

# Series of the whole server belong to no hull. This grey has a contrast above 3:1 with the light and the dark page.
NEUTRAL = "#7d8590"
MEAN, PERCENTILE = Look(NEUTRAL, ()), Look(NEUTRAL, (6, 3))

# Fences, and the subjects inside them, have one colour, whose contrast is above 4:1 with the light and the dark page.
# Their names in the picture, and dashes, distinguish them.
FENCE_COLOUR = "#9b5de5"
INSIDE = Look(FENCE_COLOUR, (), "star")
FENCE_LOOKS = tuple(Look(FENCE_COLOUR, dash) for dash in ((), (8, 3), (2, 3), (10, 3, 2, 3), (14, 4), (5, 2, 5, 6)))
