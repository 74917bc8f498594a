"""What the page's own script exchanges with the server, beside Bokeh's plots."""

from bokeh.core.properties import Bool, List, String
from bokeh.model import DataModel


class PageModel(DataModel):
    """State of one page. The script writes all text as text: a hull's name in the address could hold HTML."""

    offered = List(String, help="Names of the hulls to choose from.")
    picked = List(String, help="Names of the hulls the viewer has chosen; the script changes it.")
    legend = List(List(String), help="For each hull shown, its name and its line and marker as SVG.")
    same_scale = Bool(help="Whether x and y are drawn to one scale; the script changes it.")
    offered_fences = List(String, help="Names of the fences to choose from.")
    picked_fences = List(String, help="Names of the fences the viewer has chosen; the script changes it.")
    legend_fences = List(List(String), help="For each fence shown, its name and its line as SVG.")
    fence_hint = String(help="Why there are no fences to pick, and what to do; empty where there are.")
    banner = String(help="Why the figures are out of date, and what to do; empty while they are not.")
    note = String(help="Why the picture is empty, and what to do; empty while it is not.")
    sought = String(help="The key that the viewer looks for, empty for none; the script changes it.")
    found = List(List(String), help="For each hull shown, where the key is: a sentence, and the coordinates.")
    description = String(help="The picture in words, for screen readers.")
