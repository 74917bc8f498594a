"""How hulls that are shown together are told apart: by colour, and without it by line and marker."""

from dataclasses import dataclass

# Ink and paper are the page's: Bokeh takes --bk- properties from the style sheet.
FAINT, DRAWN = 0.5, 1.0
FILL_ALPHA = 0.12


@dataclass(frozen=True, slots=True)
class Look:
    """A hull's colour, the dashes of its lines in pixels (none for a solid line), and the marker of its vertices."""

    colour: str
    dash: tuple[int, ...]
    marker: str


# Okabe and Ito, "Color Universal Design" (2002). Those first that stand out on white and on black.
LOOKS = (
    Look("#0072B2", (), "circle"),
    Look("#D55E00", (8, 3), "square"),
    Look("#009E73", (2, 3), "triangle"),
    Look("#CC79A7", (10, 3, 2, 3), "diamond"),
    Look("#E69F00", (14, 4), "inverted_triangle"),
    Look("#56B4E9", (5, 2, 5, 6), "hex"),
)
