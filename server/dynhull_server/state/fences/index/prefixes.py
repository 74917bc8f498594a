"""Fences over a prefix: on the globe each hull has a centre of its own, and the area is laid in the plane of each."""

from collections.abc import Collection, Sequence

from dynhull.globe import MOST_METRES

from ...errors import HullUnsuitableError, InvalidFenceError
from ...hull import Hull
from ...records import Center, HullSettings
from ..model.config import FenceConfig
from ..model.fence import Fence
from .areas import center_for, check
from .checked import CheckedArea
from .globe import require_centers, require_margin
from .subjects import Subjects, area_vertices

WORDS = {False: "is a plane", True: "is geographic"}


def require_prefix(
    config: FenceConfig,
    area: Hull | None,
    hulls: Sequence[Hull],
    checked: CheckedArea | None,
    lacking: Collection[Hull] = (),
) -> None:
    """Raise the error that refuses a fence over a prefix, because of its area or of the frames of its hulls.

    Args:
        config: its settings.
        area: the hull that is its area, None for other areas.
        hulls: the keyed hulls with the prefix.
        checked: the polygons of the area, if they have been checked.
        lacking: those of the hulls that will have a centre, which they lack.
    """
    known = [*([] if area is None else [area]), *hulls]
    require_centers(known, "all hulls of a fence are geographic and have a centre, or none is", lacking)
    if any(hull.row.settings.geographic for hull in known):
        require_margin(config)
        center_for(config, area, checked)
    elif not known:
        _require_somewhere(config, checked)


def require_admissible(fence: Fence, name: str, settings: HullSettings) -> None:
    """Raise HullUnsuitableError if a fence over the prefix of a new hull cannot compare it, whatever its centre."""
    this = settings.geographic
    if this and fence.row.config.margin > MOST_METRES:
        raise _unsuitable(fence, name, f"has a margin of more than {MOST_METRES:.0f} metres, the most on the globe")
    others = [*([] if fence.area is None else [fence.area]), *(each.hull for each in fence.subjects.values())]
    for other in others[:1]:  # they are alike
        if other.row.settings.geographic != this:
            raise _unsuitable(fence, name, f"is about {other.name!r}, which {WORDS[not this]}; the hull {WORDS[this]}")


def given_center(fence: Fence, name: str) -> Center:
    """The centre that a fence gives to a new hull with its prefix, or raise HullUnsuitableError."""
    try:
        return center_for(fence.row.config, fence.area, None)
    except InvalidFenceError as error:
        raise _unsuitable(fence, name, f"has an area that is not on the globe: {error}") from None


def admit(fence: Fence, subjects: Subjects) -> None:
    """Lay the area of a fence over a new hull with its prefix, or raise HullUnsuitableError."""
    hull, config = subjects.hull, fence.row.config
    if hull.row.settings.geographic and not fence.subjects:  # nobody has looked at the area on the globe so far
        given_center(fence, hull.name)
    try:
        subjects.lay(fence.number, config, area_vertices(config, fence.area))
    except ValueError as error:
        raise _unsuitable(fence, hull.name, f"has an area that does not suit it: {error}") from None


def _require_somewhere(config: FenceConfig, checked: CheckedArea | None) -> None:
    """Raise InvalidFenceError if an area is neither one in the plane nor one on the globe."""
    if checked is not None and checked.center is not None:
        center_for(config, None, checked)
    else:
        check(config, None, checked)


def _unsuitable(fence: Fence, name: str, reason: str) -> HullUnsuitableError:
    return HullUnsuitableError(name, f"begins with the prefix of the fence {fence.name!r}, which {reason}")
