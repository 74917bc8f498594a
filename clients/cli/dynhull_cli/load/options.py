"""How to read the input of a load: the values of the command's options."""

from dataclasses import dataclass
from enum import StrEnum

from dynhull_surface.described import option_of

from ..reading.time_forms import Ambiguous, TimeForm, TimeUnit, time_form

STANDARD_INPUT = "-"


class Format(StrEnum):
    """The formats that `dynhull load` reads."""

    CSV = "csv"
    TSV = "tsv"
    PARQUET = "parquet"
    JSON = "json"
    GEOJSON = "geojson"
    NDJSON = "ndjson"
    GPKG = "gpkg"
    SHP = "shp"
    FGB = "fgb"
    GPX = "gpx"
    KML = "kml"
    XLSX = "xlsx"
    NMEA = "nmea"


@dataclass(frozen=True, slots=True)
class Options:
    """How to read the input; None for what is to be detected. The fields are the options of the command.

    Attributes:
        x: the column or member of x.
        y: the column or member of y.
        delimiter: the character between columns of CSV.
        decimal: the decimal mark of CSV.
        header: whether the first row of CSV names the columns.
        encoding: the encoding of text.
        vertices: whether to take the vertices of geometries other than single points.
        key: the column or member of the keys; None for points without keys.
        time: the column or member of the times; None for points without times.
        time_unit: the unit of times that are numbers.
        expires: the column or member of the times at which keys leave; None for points that stay.
        layer: the layer, of files that have several.
        geometry: the column of geometries.
        time_zone: the time zone of times that have none.
        ambiguous: what becomes of times that exist twice or not at all in it.
        time_format: the form of times, for strptime.
        accuracy: the column or member of the accuracies; None for positions without an error.
    """

    x: str | None = None
    y: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    header: bool | None = None
    encoding: str | None = None
    vertices: bool = False
    key: str | None = None
    time: str | None = None
    time_unit: TimeUnit | None = None
    expires: str | None = None
    layer: str | None = None
    geometry: str | None = None
    time_zone: str | None = None
    ambiguous: Ambiguous = Ambiguous.REFUSE
    time_format: str | None = None
    accuracy: str | None = None

    @property
    def labels(self) -> tuple[tuple[str, str | None], ...]:
        """The options that name the columns of keys, times, times to leave and accuracies, and these columns."""
        names = self.key, self.time, self.expires, self.accuracy
        return tuple(zip(("--key", "--time", "--expires", "--accuracy"), names, strict=True))

    def time_form(self) -> TimeForm:
        """How times are written. ValueError names the option that is wrong."""
        return time_form(option_of, self.time_unit, self.time_zone, self.ambiguous, self.time_format)
