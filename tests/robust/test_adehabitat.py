"""`mcp` against polygons of the R package adehabitatHR, recorded by benchmarks/mcp.py."""

import json
from pathlib import Path

import pytest
from hulls import HULLS

RECORDED = json.loads((Path(__file__).parents[1] / "data" / "mcp.json").read_text())


@pytest.mark.parametrize("recorded", RECORDED["sets"], ids=lambda each: each["name"])
@pytest.mark.parametrize("make", HULLS.values(), ids=HULLS.keys())
def test_the_polygons_of_adehabitat(make, recorded):
    hull = make(recorded["points"])
    for percent, polygon in zip(RECORDED["percents"], recorded["polygons"], strict=True):
        assert hull.mcp(percent).tolist() == make(polygon).vertices().tolist()  # corners of theirs may lie on sides
