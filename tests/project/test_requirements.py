"""What developers install: pip, which knows no lock file, goes back release by release as far as a bound allows."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
FOR_DEVELOPERS = ("docs", "test-core", "test", "check")
NAMED = re.compile(r"(?P<name>[\w.-]+)(?:\[.*\])?(?P<bounds>[^;]*)")


def release(version: str) -> tuple[int, ...]:
    """The part of a version that says what may break: the first number, and the second where that is 0."""
    numbers = [*map(int, re.match(r"[\d.]+", version)[0].strip(".").split(".")), 0]
    return tuple(numbers[: 1 if numbers[0] else 2])


@pytest.mark.parametrize("extra", FOR_DEVELOPERS)
def test_bounds_of_what_developers_install_are_near_the_lock(extra: str) -> None:
    packages = tomllib.loads((ROOT / "uv.lock").read_text())["package"]
    far = []
    for requirement in EXTRAS[extra]:
        name, bounds = NAMED.fullmatch(requirement).group("name", "bounds")
        locked = [release(each["version"]) for each in packages if each["name"] == name]
        lower = re.search(r"[>=]=([\d.]+)", bounds)
        if name != "dynhull" and (lower is None or release(lower[1]) < min(locked)):
            far.append(f"{requirement}, locked are {locked}")
    assert far == []
