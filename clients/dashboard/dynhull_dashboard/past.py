"""The past of a hull's time lines: what the server has kept of its measures."""

from collections.abc import Iterator

import numpy as np

from dynhull_client import Series

from .degrees import SQUARE_KILOMETRE

LONGEST_SECONDS = 3600.0


def past_rows(series: Series, now: float) -> Iterator[tuple[float, ...]]:
    """Rows of time in milliseconds, points, vertices, area and rate, each a point of a line.

    Where a hull was unchanged for long, its line is level: there is a row before the change, too. The last row is of
    `now`, whatever the server's clock says.
    """
    apart = 1000 * (series.interval or LONGEST_SECONDS)
    times = np.maximum(series.times.astype("datetime64[us]").view(np.int64) / 1000, 1000 * series.since.timestamp())
    times += now - times[-1]
    areas = series.areas / SQUARE_KILOMETRE if series.geographic else series.areas
    columns = zip(series.points.tolist(), series.vertices.tolist(), areas.tolist(), strict=True)
    before = None
    for time, figures, rate in zip(times.tolist(), columns, series.rates.tolist(), strict=True):
        if before is not None and time - before[0] > 2 * apart:
            yield time - apart, *before[1], 0.0
        yield time, *figures, rate
        before = time, figures
