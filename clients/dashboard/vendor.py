"""Copy what the page uses of others into dynhull_dashboard/vendor, with its licences: `make vendor`, after `npm ci`."""

import json
import shutil
from pathlib import Path

HERE = Path(__file__).parent
MODULES = HERE / "node_modules"
VENDOR = HERE / "dynhull_dashboard" / "vendor"
FILES = {
    "d3-array": ["dist/d3-array.min.js"],
    "internmap": [],  # in d3-array.min.js
    "d3-geo": ["dist/d3-geo.min.js"],
    "topojson-client": ["dist/topojson-client.min.js"],
    "world-atlas": ["countries-110m.json", "countries-50m.json"],
}
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
            shutil.copyfile(package / file, VENDOR / Path(file).name)
        version = json.loads((package / "package.json").read_text("utf-8"))["version"]
        what = ", ".join(Path(file).name for file in files) or "in d3-array.min.js"
        texts.append(f"{name} {version}: {what}\n\n{(package / 'LICENSE').read_text('utf-8')}")
    (VENDOR / "LICENSES.txt").write_text(f"\n{'-' * 79}\n".join(texts), "utf-8")


if __name__ == "__main__":
    main()
