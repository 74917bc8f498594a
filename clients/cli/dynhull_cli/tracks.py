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
        for time, place, revision, sent, accuracy in _rows(track):
            more = ({} if sent is None else {"event_time": sent}) | ({"accuracy": accuracy} if accuracy else {})
            yield json_line(key=key, time=time, position=place, revision=revision, **more)


def csv_lines(ways: Ways) -> Iterator[str]:
    """Columns key, time, x, y, revision, event_time, and accuracy if one has any; x and y are empty where it left."""
    with_accuracies = any(track.accuracies is not None for track in ways.values())
    yield "key,time,x,y,revision,event_time" + ",accuracy" * with_accuracies
    for key, track in ways.items():
        for time, place, revision, sent, accuracy in _rows(track):
            text = io.StringIO()
            x, y = ("", "") if place is None else place
            last = [accuracy or ""] * with_accuracies
            csv.writer(text, lineterminator="").writerow([key, time, x, y, revision, sent or "", *last])
            yield text.getvalue()


def feature_collection(ways: Ways) -> str:
    """A GeoJSON FeatureCollection (RFC 7946)."""
    return json_line(type="FeatureCollection", features=[feature(key, track) for key, track in ways.items()])


def feature(key: str | int, track: Track) -> dict[str, Any]:
    """A way as a GeoJSON Feature: each of its lines from where the key came into the hull up to where it left.

    Each place has a time, and an accuracy if one has any.
    """
    parts: list[list[tuple[list[float], str | None, float]]] = []
    went_on = False
    for time, place, _, _, accuracy in _rows(track):
        if place is not None and not went_on:
            parts.append([])
        went_on = place is not None
        if place is not None:
            parts[-1].append((place, time, accuracy))
    is_point = [*map(len, parts)] == [1]
    if not is_point:
        parts = [part if len(part) > 1 else part * 2 for part in parts]  # a line has two places
    places, times, accuracies = ([[row[column] for row in part] for part in parts] for column in range(3))
    geometry: dict[str, Any] | None = None
    if is_point:
        geometry = {"type": "Point", "coordinates": places[0][0]}
    elif len(parts) == 1:
        geometry = {"type": "LineString", "coordinates": places[0]}
    elif parts:
        geometry = {"type": "MultiLineString", "coordinates": places}
    properties: dict[str, Any] = {"key": key, "times": times[0] if len(parts) == 1 else times}
    if track.accuracies is not None:
        properties["accuracies"] = accuracies[0] if len(parts) == 1 else accuracies
    return {"type": "Feature", "id": key, "geometry": geometry, "properties": properties}


def shown_times(times: Any) -> list[str | None]:
    """Microseconds as RFC 3339; None for none."""
    return [f"{time}Z" if time.astype(int) else None for time in times.astype("datetime64[us]")]


def _rows(track: Track) -> Iterator[tuple[str | None, list[float] | None, int, str | None, float]]:
    """Time, place, revision, event time and accuracy; None for no place, and for no time."""
    sent: list[str | None] = [None] * len(track)
    if track.event_times is not None:
        sent = shown_times(track.event_times)
    gone = np.isnan(track.points[:, 0])
    places = [None if left else place for left, place in zip(gone.tolist(), track.points.tolist(), strict=True)]
    accuracies = [0.0] * len(track) if track.accuracies is None else track.accuracies.tolist()
    yield from zip(shown_times(track.times), places, track.revisions.tolist(), sent, accuracies, strict=True)
