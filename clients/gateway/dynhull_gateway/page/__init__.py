"""The dashboard: a page that shows hulls, fences and alarms, drawn in the browser by the package for browsers.

What it needs are files, and calls of the gateway that are others' too; but for the metrics of the server, which the
page cannot ask.
"""

import base64
import gzip
import hashlib
import json
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from dynhull_surface.described import described
from dynhull_surface.settings import FenceSettings

from ..tiles import Tiles
from .metrics import Metrics

HERE = Path(__file__).parent
# Libraries and maps of others, as published; their licences are in LICENSES.txt.
VENDOR = HERE / "vendor"
# The package for browsers: of the source code, or beside the other files.
PACKAGE = next(each for each in (HERE / "dynhull", HERE.parents[2] / "typescript" / "src") if each.exists())
TYPES = {
    ".js": "text/javascript",
    ".mjs": "text/javascript",
    ".css": "text/css",
    ".json": "application/json",
    ".txt": "text/plain",
}
IMPORTED = {
    "d3-geo": "d3-geo.min.mjs",
    "d3-array": "d3-array.min.mjs",
    "internmap": "internmap/index.js",
    "lossless-json": "lossless-json/index.js",
    "robust-predicates": "robust-predicates/orient2d.js",
    "topojson-client": "topojson-client/index.js",
}
PATH = "/dashboard"


@dataclass(frozen=True)
class PageSettings:
    """What the page shows, and of which server.

    Attributes:
        address: the server, as its users name it.
        prefix: only hulls, fences and alarms whose names begin with it are offered.
        x_unit: the unit of x; empty if it is not known.
        y_unit: that of y.
        tiles: a map of another server; None for none.
        metrics: the server's page for Prometheus; None for none.
    """

    address: str = ""
    prefix: str = ""
    x_unit: str = ""
    y_unit: str = ""
    tiles: Tiles | None = None
    metrics: Metrics | None = None

    @property
    def area_unit(self) -> str:
        """The unit of areas in a plane."""
        if self.x_unit == self.y_unit:
            return f"{self.x_unit}²" if self.x_unit else "square units"
        return f"{self.x_unit or 'x'} by {self.y_unit or 'y'}"

    @property
    def area_heading(self) -> str:
        """The units of areas in a plane and on the globe."""
        return "km²" if self.area_unit == "km²" else f"{self.area_unit}; km² on the globe"


@dataclass(frozen=True)
class Asset:
    """A file of the page.

    Attributes:
        content: its bytes.
        media_type: its type.
    """

    content: bytes
    media_type: str

    @cached_property
    def compressed(self) -> bytes:
        """The same, by gzip."""
        return gzip.compress(self.content, 6)


@dataclass
class Dashboard:
    """The page with its files.

    Args:
        settings: what it shows.
        root: the path below which a proxy shows the gateway.
    """

    settings: PageSettings
    root: str = ""
    files: dict[str, Asset] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        for prefix, folder in (("", HERE), ("dynhull/", PACKAGE)):
            for path in sorted(folder.rglob("*")):
                if path.suffix in TYPES:
                    name = prefix + path.relative_to(folder).as_posix()
                    self.files[name] = Asset(path.read_bytes(), TYPES[path.suffix])

    @cached_property
    def version(self) -> str:
        """Names the files and the settings: a page of another version loads anew."""
        known = hashlib.sha256(self._template.encode() + json.dumps(self._shown).encode())
        for name, asset in self.files.items():
            known.update(name.encode() + asset.content)
        return known.hexdigest()[:16]

    @property
    def html(self) -> str:
        """The page as HTML."""
        settings = self.settings
        values = {
            "files": self._folder,
            "address": settings.address,
            "area_unit": settings.area_heading,
            "metrics": "true" if settings.metrics else "",
            "settings": json.dumps({**self._shown, "files": self._folder, "version": self.version}),
        }
        texts = {name: escape(value) for name, value in values.items()}
        return Template(self._template).substitute(texts, imports=self._imports)

    @property
    def policy(self) -> str:
        """The Content-Security-Policy: nothing but its own, and pictures from the server of the tiles."""
        imports = base64.b64encode(hashlib.sha256(self._imports.encode()).digest()).decode()
        pictures = f" {self.settings.tiles.origin}" if self.settings.tiles else ""
        return (
            f"default-src 'none'; script-src 'self' 'sha256-{imports}'; style-src 'self'; img-src data:{pictures}; "
            "connect-src 'self'; base-uri 'none'; form-action 'none'"
        )

    @cached_property
    def _template(self) -> str:
        return (HERE / "page.html").read_text("utf-8")

    @property
    def _folder(self) -> str:
        return f"{self.root}{PATH}/{self.version}"

    @property
    def _imports(self) -> str:
        return json.dumps({"imports": {name: f"{self._folder}/vendor/{file}" for name, file in IMPORTED.items()}})

    @cached_property
    def _shown(self) -> dict[str, Any]:
        settings = self.settings
        tiles = settings.tiles
        return {
            "root": self.root,
            "address": settings.address,
            "prefix": settings.prefix,
            "units": {"x": settings.x_unit, "y": settings.y_unit, "area": settings.area_unit},
            "metrics": settings.metrics.url if settings.metrics else "",
            "tiles": {
                "url": tiles.url if tiles else "",
                "largest_zoom": tiles.largest_zoom if tiles else 0,
                "attribution": tiles.attribution if tiles else "",
            },
            "fence_settings": _fence_settings(),
        }


def _fence_settings() -> list[dict[str, Any]]:
    """The name, the kind and the usual value of each setting of a fence that can be seen."""
    kinds = {bool: "flag", str: "text", int: "number", float: "number"}
    return [
        {"name": each.name, "kind": "choice" if each.choices else kinds.get(each.kind, "span"), "usual": each.usual}
        for each in described(FenceSettings)
        if not each.at_creation
    ]
