"""Copy what the page uses of others into dynhull_gateway/page/vendor, with licences: `make vendor`, after `npm ci`."""

import json
import shutil
from pathlib import Path

HERE = Path(__file__).parent
MODULES = HERE / "node_modules"
VENDOR = HERE / "dynhull_gateway" / "page" / "vendor"
# Files as they are, or a folder of modules.
FILES = {
    "d3-array": ["dist/d3-array.min.mjs"],
    "d3-geo": ["dist/d3-geo.min.mjs"],
    "internmap": ["src"],
    "lossless-json": ["lib/esm"],
    "robust-predicates": ["esm/orient2d.js", "esm/util.js"],  # the one that is needed, of many
    "topojson-client": ["src"],
    "world-atlas": ["countries-110m.json", "countries-50m.json"],
}
SINGLE = "d3-array", "d3-geo", "world-atlas"
LICENSES = "LICENSE", "LICENSE.md"
HEADING = """The files of this folder, as published on npm. `make vendor` brings newer ones.
The countries of world-atlas are made from Natural Earth, which is in the public domain (naturalearthdata.com).
"""


def main() -> None:
    """Replace all files of the folder."""
    shutil.rmtree(VENDOR, ignore_errors=True)
    VENDOR.mkdir()
    texts = [HEADING]
    for name, files in FILES.items():
        package = MODULES / name
        for file in files:
            _copy(package / file, VENDOR if name in SINGLE else VENDOR / name)
        version = json.loads((package / "package.json").read_text("utf-8"))["version"]
        what = ", ".join(Path(file).name for file in files) if name in SINGLE else f"{name}/"
        licence = next(package / each for each in LICENSES if (package / each).exists())
        texts.append(f"{name} {version}: {what}\n\n{licence.read_text('utf-8')}")
    (VENDOR / "LICENSES.txt").write_text(f"\n{'-' * 79}\n".join(texts), "utf-8")


def _copy(source: Path, folder: Path) -> None:
    """A file into the folder; of a folder its modules."""
    modules = (
        [source] if source.is_file() else [each for each in source.rglob("*.js") if not each.name.endswith(".test.js")]
    )
    for module in modules:
        target = folder / (source.name if module == source else module.relative_to(source))
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(module, target)


if __name__ == "__main__":
    main()
