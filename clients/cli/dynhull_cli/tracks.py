"""The ways of keys as lines, as CSV and as GeoJSON."""

import csv
import io
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dynhull_client import Track

from .json_lines import json_line
from .tab_lines import tab_line

Ways = Mapping[str | int, Track]


def lines(ways: Ways) -> Iterator[str]:
    """Key, time, x and y between tabs."""
    for key, track in ways.items():
        for time, point in zip(shown_times(track.times), track.points, strict=True):
            yield tab_line(key, time, point)


def json_lines(ways: Ways) -> Iterator[str]:
    """An object for each place."""
    for key, track in ways.items():
        for time, place, revision, sent in _rows(track):
            dated = {} if sent is None else {"event_time": sent}
            yield json_line(key=key, time=time, position=place, revision=revision, **dated)


def csv_lines(ways: Ways) -> Iterator[str]:
    """Columns key, time, x, y, revision, event_time; x and y are empty where a key left."""
    yield "key,time,x,y,revision,event_time"
    for key, track in ways.items():
        for time, place, revision, sent in _rows(track):
            text = io.StringIO()
            x, y = ("", "") if place is None else place
            csv.writer(text, lineterminator="").writerow([key, time, x, y, revision, sent or ""])
            yield text.getvalue()


def feature_collection(ways: Ways) -> str:
    """A GeoJSON FeatureCollection (RFC 7946)."""
    return json_line(type="FeatureCollection", features=[feature(key, track) for key, track in ways.items()])


def feature(key: str | int, track: Track) -> dict[str, Any]:
    """A way as a GeoJSON Feature: each of its lines from where the key came into the hull up to where it left."""
    parts: list[tuple[list[Any], list[Any]]] = []
    went_on = False
    for time, place, _, _ in _rows(track):
        if place is not None and not went_on:
            parts.append(([], []))
        went_on = place is not None
        if place is not None:
            parts[-1][0].append(place)
            parts[-1][1].append(time)
    pieces = [places if len(places) > 1 else places * 2 for places, _ in parts]  # a line has two places
    times = [times if len(times) > 1 else times * 2 for _, times in parts]
    geometry: dict[str, Any] | None = None
    if len(parts) == 1 and len(parts[0][0]) == 1:
        geometry, times = {"type": "Point", "coordinates": parts[0][0][0]}, [parts[0][1]]
    elif len(parts) == 1:
        geometry = {"type": "LineString", "coordinates": pieces[0]}
    elif parts:
        geometry = {"type": "MultiLineString", "coordinates": pieces}
    shown = times[0] if len(parts) == 1 else times
    return {"type": "Feature", "id": key, "geometry": geometry, "properties": {"key": key, "times": shown}}


def shown_times(times: Any) -> list[str | None]:
    """Microseconds as RFC 3339; None for none."""
    return [f"{time}Z" if time.astype(int) else None for time in times.astype("datetime64[us]")]


def _rows(track: Track) -> Iterator[tuple[str | None, list[float] | None, int, str | None]]:
    """Time, place, revision and event time; None for no place, and for no time."""
    sent: list[str | None] = [None] * len(track)
    if track.event_times is not None:
        sent = shown_times(track.event_times)
    gone = np.isnan(track.points[:, 0])
    places = [None if left else place for left, place in zip(gone.tolist(), track.points.tolist(), strict=True)]
    yield from zip(shown_times(track.times), places, track.revisions.tolist(), sent, strict=True)
