"""The door between degrees and the plane, and measures of a hull on the globe given by its (h, 2) vertices.

`GeoHull` does all of this by itself. These functions are for vertices and places that are elsewhere, such as copies of
a hull: counter-clockwise, in degrees, longitude first, as `GeoHull.vertices` returns them.

>>> from dynhull.globe import Gnomonic, area, as_lonlat
>>> fiji = as_lonlat([(-179.9, -16.8), (179.4, -16.4), (177.4, -17.8), (178.4, -18.1)])
>>> frame = Gnomonic.about(fiji)
>>> frame.project_all(fiji).shape
(4, 2)
>>> round(area(fiji) / 1e6)  # square kilometres
21100
"""

from ._ellipsoid import Boundary, area, diameter, distance, perimeter
from ._flat_map import boundary, geojson
from ._globe import REACH, Gnomonic, as_center, as_lonlat
from ._globe_extent import bounds, label_point
from ._globe_part import project_far, project_hull
from ._globe_sketch import sketch
from ._metres import MOST_METRES, Metres

__all__ = [
    "MOST_METRES",
    "REACH",
    "Boundary",
    "Gnomonic",
    "Metres",
    "area",
    "as_center",
    "as_lonlat",
    "boundary",
    "bounds",
    "diameter",
    "distance",
    "geojson",
    "label_point",
    "perimeter",
    "project_far",
    "project_hull",
    "sketch",
]
