"""Crossings of fences as an index has them, for who passes many on and looks at few: see `FenceIndex.take_packed`.

>>> import dynhull
>>> from dynhull.crossings import pack
>>> fences = dynhull.FenceIndex(dynhull.KeyedHull())
>>> pack(fences.take()) is fences.take_packed() is None
True
"""

from ._crossings import PackedCrossings, pack

__all__ = ["PackedCrossings", "pack"]
