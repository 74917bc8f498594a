"""The page that says what holds has every format of folders and databases."""

import re
from pathlib import Path

from dynhull_cluster.postgres.schema import FIRST_FORMAT, MIGRATIONS
from dynhull_server.storage.rows.hull_rows import FORMATS
from dynhull_server.storage.sqlite.schema import FORMAT, SCHEMAS

PAGE = Path(__file__).parents[2] / "docs" / "guarantees.md"
TABLE = re.compile(r"\| format \| what it added \|\n *\|[- |]+\|\n((?: *\|.*\|\n)+)")


def test_the_table_of_formats_has_all_that_can_be_read() -> None:
    rows = [
        [cell.strip() for cell in row.strip().strip("|").split("|")]
        for row in TABLE.search(PAGE.read_text())[1].splitlines()
    ]
    assert [int(version) for version, _ in rows] == sorted(SCHEMAS) == sorted(FORMATS) == [*range(1, FORMAT + 1)]
    assert sorted(MIGRATIONS) == [*range(FIRST_FORMAT, FORMAT)]
    added = [added for _, added in rows[1:]]
    assert all(added)
    assert len(set(added)) == len(added)
