"""Programs and packages that tests need and pip does not install.

Where one is missing, its tests are skipped, and the summary counts them. With DYNHULL_REQUIRE_PEERS=1, which `.ci/run`
sets, they fail.
"""

import os
import shutil
from pathlib import Path
from typing import NoReturn

import pytest

JAVASCRIPT = Path(__file__).parents[1] / "javascript"
TYPESCRIPT = Path(__file__).parents[2] / "clients" / "typescript"
INSTALLED_BY = {
    "caddy": "Debian's package caddy",
    "chromium-headless-shell": "Debian's package chromium-headless-shell",
    "faketime": "Debian's package faketime",
    "mosquitto": "Debian's package mosquitto",
    "nats-server": "Debian's package nats-server",
    "nginx": "Debian's package nginx-light",
    "ogr2ogr": "Debian's package gdal-bin",
    "ogrinfo": "Debian's package gdal-bin",
    "node": "Debian's package nodejs",
    "postgres": "Debian's package postgresql",
    "initdb": "Debian's package postgresql",
    "prometheus": "Debian's package prometheus",
    "promtool": "Debian's package prometheus",
    "systemd-analyze": "Debian's package systemd",
    "c++": "a C++20 compiler",
}


def missing(what: str, remedy: str) -> NoReturn:
    """Skip the test; fail it where every peer is required."""
    if os.environ.get("DYNHULL_REQUIRE_PEERS") == "1":
        pytest.fail(f"no {what}: {remedy}", pytrace=False)
    pytest.skip(f"no {what}: {remedy}")


def program(name: str, *others: str) -> str:
    """The path of a program, or of another one that does as well."""
    found = next(filter(None, map(shutil.which, (name, *others))), None)
    return found or missing(name, f"install {INSTALLED_BY.get(name, name)} (see `make peers`)")


def javascript() -> Path:
    """The folder of the JavaScript client, with its npm packages."""
    if not (JAVASCRIPT / "node_modules" / "@grpc").is_dir():
        missing("npm packages", "run `make peers`")
    return JAVASCRIPT


def axe() -> str:
    """The script of axe-core, which finds what people with other senses cannot use of a page."""
    script = JAVASCRIPT / "node_modules" / "axe-core" / "axe.min.js"
    return script.read_text("utf-8") if script.exists() else missing("axe-core", "run `make peers`")


def typescript() -> Path:
    """The folder of the TypeScript package, with the npm packages that it needs."""
    if not (TYPESCRIPT / "node_modules" / "typescript").is_dir():
        missing("npm packages", "run `make peers`")
    return TYPESCRIPT
