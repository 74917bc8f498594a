"""Points of tables of Arrow, a batch of rows at a time: those of Parquet files and of the layers that GDAL reads."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..reading.columns import column_index
from ..reading.labels import Labels
from ..reading.values import LARGEST_EXACT, coordinate
from .chunks import Chunk, Chunks, Numbers, Position, Rows, picked
from .geometry_column import GeometryColumn, Value
from .source import Source

AXES = ["x", "y"]

OfRow = Callable[[int], Labels]
"""Reads the labels of a row of a batch, given by its number."""


@dataclass(frozen=True)
class ArrowTable:
    """A table that is read once.

    Attributes:
        source: the input.
        names: the names of its columns.
        batches: returns its batches with these columns.
        unit: what is counted: rows, say.
        numbers: the column of their numbers, which is in all batches; None for 1 and so on.
    """

    source: Source
    names: list[str]
    batches: Callable[[list[str]], Iterator[Any]]
    unit: str = "row"
    numbers: str | None = None

    def of_columns(self, x: str, y: str) -> Chunks:
        """Chunks of points from the columns of x and y."""
        self.source.axes.extend((x, y))
        for batch, labels, numbers in self._read([x, y]):
            yield self._of_numbers([batch[x], batch[y]], [x, y], labels, numbers)

    def of_geometries(self, column: str, *, system_known: bool) -> Chunks:
        """Chunks of points from a column of geometries: well-known binary or text, or the points of GeoArrow.

        `system_known` says whether the input has said in which coordinate reference system they are.
        """
        geometries = GeometryColumn(self.source, column, system_known=system_known)
        for batch, labels, numbers in self._read([column]):
            array = _plain(batch[column])
            if pa.types.is_struct(array.type):
                axes = [pc.struct_field(array, axis) for axis in AXES]
                yield self._of_numbers(axes, AXES, labels, numbers)
            elif pa.types.is_fixed_size_list(array.type):
                axes = [pc.list_element(array, axis) for axis in range(len(AXES))]
                yield self._of_numbers(axes, AXES, labels, numbers)
            else:
                yield self._of_values(array.to_pylist(), geometries, labels, numbers)

    def _read(self, columns: list[str]) -> Iterator[tuple[Any, OfRow | None, Numbers]]:
        """Each batch, what reads the labels of its rows, and their numbers."""
        read = self.source.label_reader()
        more = [
            None if name is None else self.names[column_index(self.source.name, self.names, option, name)]
            for option, name in self.source.options.labels
        ]
        first = 1
        for batch in self.batches([*columns, *filter(None, more)]):
            labels = None
            if read is not None:
                values = [[None] * len(batch) if name is None else batch[name].to_pylist() for name in more]
                labels = lambda row, read=read, values=values: read(*(column[row] for column in values))  # noqa: E731
            if self.numbers is None:
                numbers = np.arange(first, first + len(batch))
            else:
                numbers = batch[self.numbers].to_numpy(zero_copy_only=False)
            yield batch, labels, numbers
            first += len(batch)

    def _of_numbers(self, arrays: list[Any], names: list[str], labels: OfRow | None, numbers: Numbers) -> Chunk:
        if labels is None and not any(pa.types.is_string(each.type) for each in arrays):
            with suppress(pa.ArrowInvalid):  # an integer that is no double
                points = np.stack([each.cast(pa.float64()).to_numpy(zero_copy_only=False) for each in arrays], axis=1)
                if (np.abs(points) < LARGEST_EXACT).all():
                    return Chunk(Rows(points + 0.0, numbers, self.unit))
        rows = list(zip(*(each.to_pylist() for each in arrays), strict=True))

        def position(row: int) -> list[Position]:
            x, y = map(coordinate, rows[row], names)
            return [(x, y)]

        return self._picked(numbers, position, lambda row: str(rows[row]), labels)

    def _of_values(
        self, rows: list[Value], geometries: GeometryColumn, labels: OfRow | None, numbers: Numbers
    ) -> Chunk:
        points = None if labels is not None else geometries.points(rows)
        if points is not None:
            return Chunk(Rows(points, numbers, self.unit))
        return self._picked(numbers, lambda row: geometries.positions(rows[row]), lambda row: _text(rows[row]), labels)

    def _picked(
        self,
        numbers: Numbers,
        of_row: Callable[[int], list[Position]],
        text: Callable[[int], str],
        labels: OfRow | None,
    ) -> Chunk:
        rows = zip(numbers.tolist(), range(len(numbers)), strict=True)
        return picked(self.unit, rows, of_row, text, labels)


def _plain(array: Any) -> Any:
    """The array without what an extension type or a dictionary puts around it."""
    array = array.storage if isinstance(array, pa.ExtensionArray) else array
    return array.dictionary_decode() if pa.types.is_dictionary(array.type) else array


def _text(value: Value) -> str:
    return value.hex() if isinstance(value, bytes) else "" if value is None else str(value)
