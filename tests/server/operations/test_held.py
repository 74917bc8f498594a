"""What a server holds takes about as much as the documentation says: by counting, not by measuring."""

import asyncio
import re
import sys
from contextlib import AsyncExitStack
from pathlib import Path
from subprocess import PIPE

import counted_server
import pytest
from cases import slow
from forked import Process
from holdings import KINDS, OPTIONS, Hold
from patience import PATIENCE

from dynhull._implementation import kernel
from dynhull_client import AsyncHullClient

if kernel is None:
    pytest.skip("the implementation in Python takes more", allow_module_level=True)

PAGE = Path(__file__).parents[3] / "docs" / "performance.md"
# A version of Python may take so much more, or less, for its objects.
MORE, LESS = 1.15, 0.75
# Few are enough: a count has no noise.
FEWER = 10
# The others fill servers for seconds.
QUICK = {"point", "key, an integer", "hull, empty", "watch of a hull"}


def table() -> dict[str, int]:
    """The bytes that are counted for each, as documented."""
    section = PAGE.read_text().partition("\n### What a server holds\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| ([^|]+) \| [\d,]+ \| ([\d,]+) \|$", section, re.MULTILINE)
    return {name: int(counted.replace(",", "")) for name, counted in rows}


def test_each_kind_has_its_row() -> None:
    assert list(table()) == list(KINDS)


@pytest.mark.parametrize("kind", [pytest.param(kind, marks=() if kind in QUICK else slow) for kind in KINDS])
def test_each_takes_what_is_documented(kind: str) -> None:
    count, hold = KINDS[kind]
    counted, documented = asyncio.run(_counted(hold, max(count // FEWER, 50))), table()[kind]
    assert LESS * documented <= counted <= MORE * documented, f"{counted:.0f} bytes; documented are {documented}"


async def _counted(hold: Hold, count: int) -> float:
    """The bytes of each of `count` more, after as many."""
    command = [sys.executable, counted_server.__file__, *OPTIONS]
    with Process(command, stdin=PIPE, stdout=PIPE, text=True) as process:
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            answers = process.stdout

            def counted() -> int:
                assert process.stdin is not None
                process.stdin.write("\n")
                process.stdin.flush()
                return int(answers.readline())

            address = answers.readline().split()[-1]
            async with AsyncHullClient(address) as client, AsyncExitStack() as stack:
                counted()
                await hold(client, stack, 0, count)
                before = counted()
                await hold(client, stack, count, 2 * count)
                return (counted() - before) / count
        finally:
            process.terminate()
            process.wait(PATIENCE)
