"""Numbers in bodies: read as the nearest double, and never from a text."""

from typing import Annotated

from pydantic import Field

LARGEST = 2**64 - 1

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Seconds = Annotated[float, Field(strict=True, ge=0, le=1e9, allow_inf_nan=False)]
# Pairs are lists of two: their JSON schema, unlike that of tuples, is the same in every draft.
Point = Annotated[list[Number], Field(min_length=2, max_length=2)]
