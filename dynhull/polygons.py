"""Polygons that are checked once and used often, or checked elsewhere than where they are used.

>>> import dynhull
>>> from dynhull.polygons import CheckedPolygons
>>> checked = CheckedPolygons([[[[0, 0], [4, 0], [0, 4]]]])
>>> fences = dynhull.FenceIndex(dynhull.KeyedHull())
>>> fences.set_polygons(7, checked)
>>> fences.set_polygons(8, checked, closed=False)
"""

from ._rings import CheckedPolygons

__all__ = ["CheckedPolygons"]
