"""What people may import: the documented modules and names, and nothing else without an underscore."""

import json
import pickle
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import dynhull

REFERENCE = Path(__file__).parents[2] / "docs" / "reference" / "library"

PACKAGES = {
    "dynhull": {
        *("KERNEL", "DynamicHull", "MissingPointError", "WindowHull", "convex_hull", "orient2d", "set_threads"),
        *(
            "KeyedHull",
            "KeyedLoader",
            "PackedHull",
            "Put",
            "DuplicateKeyError",
            "MissingKeyError",
            "FenceIndex",
            "Crossings",
        ),
        *("GeoHull", "GeoKeyedHull", "GeoWindowHull"),
        *("arrays", "keys", "measure", "robust", "static"),  # imported with it
    },
    "dynhull.envelope": {"Decomposition", "Frontier", "PhaseDiagram", "energy_above_hull_nd"},
    "dynhull.globe": {
        *(
            "MOST_METRES",
            "REACH",
            "Boundary",
            "Gnomonic",
            "Metres",
            "area",
            "as_center",
            "as_lonlat",
            "boundary",
            "bounds",
        ),
        *("diameter", "distance", "geojson", "label_point", "perimeter", "sketch"),
        *("project_far", "project_hull"),
    },
    "dynhull.gjk": {"Contact", "contact", "distance_many", "intersect", "intersect_many"},
    "dynhull.measure": {
        *("area", "bounds", "centroid", "diameter", "distance", "intersect_lines"),
        *("label_point", "min_box", "min_circle", "min_perimeter_box", "perimeter", "width"),
        *("FEW", "Summary", "summary", "Compared", "compare", "LastVertices"),
    },
    "dynhull.robust": {"depth", "nearest_points"},
    "dynhull.static": {
        *("HullND", "chan", "convex_hull", "graham_scan", "hull_nd", "jarvis_march", "monotone_chain"),
        "trace",
    },
}


MODULES = {"dynhull", *(module.name for module in walk_packages(dynhull.__path__, "dynhull."))}


def documented() -> set[str]:
    """The modules that the pages have whole, or in parts."""
    listed = {
        name for page in REFERENCE.glob("*.md") for name in re.findall(r"^::: (\S+)", page.read_text(), re.MULTILINE)
    }
    return {name if name in MODULES else name.rpartition(".")[0] for name in listed}


def test_packages_have_the_documented_names_and_no_others():
    """In a fresh interpreter, `dynhull` first: a package has the modules that are imported, too."""
    script = (
        f"import importlib, json; names = {list(PACKAGES)}\n"
        "print(json.dumps({name: dir(importlib.import_module(name)) for name in names}))"
    )
    run = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    for package, names in json.loads(run.stdout).items():
        assert {name for name in names if not name.startswith("_")} == PACKAGES[package], package
        assert set(import_module(package).__all__) - {"__version__"} <= PACKAGES[package]
        assert package in documented()


def test_every_module_is_documented_or_marked_as_private():
    public = {name for name in MODULES if not any(part.startswith("_") for part in name.split("."))}
    assert public == documented()


def test_every_documented_module_is_there_without_an_import_of_its_own():
    names = sorted(name for name in documented() if name.count(".") == 1 and name.startswith("dynhull."))
    script = "import dynhull\n" + "\n".join(name for name in names if name != "dynhull.ray")
    subprocess.run([sys.executable, "-c", script], check=True)


def test_the_classes_are_named_as_they_are_imported():
    assert repr(dynhull.DynamicHull) == "<class 'dynhull.DynamicHull'>"
    assert repr(dynhull.MissingPointError) == "<class 'dynhull.MissingPointError'>"


def test_pickles_of_version_0_1_load():
    """They name the class by the module that it was in."""
    hull = dynhull.DynamicHull([[0, 0], [4, 0], [4, 4], [2, 1], [2, 1]])
    now = pickle.dumps(hull, protocol=2)
    then = now.replace(b"cdynhull\nDynamicHull\n", b"cdynhull.hull\nDynamicHull\n")
    assert then != now
    assert pickle.loads(then) == hull
