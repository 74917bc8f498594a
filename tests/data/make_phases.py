"""Write phases.json: the answers of pymatgen's PhaseDiagram on the formation energies that come with pymatgen.

    pip install pymatgen && python tests/data/make_phases.py > tests/data/phases.json

By hand: pymatgen with what it needs takes longer to install, and more room, than everything else the tests use. The
energies are the measured ones of `pymatgen.analysis.compatibility`, in eV for a formula; elements have none.
"""

import gzip
import importlib.metadata
import json
import random
from collections import Counter
from pathlib import Path

import pymatgen.analysis.compatibility
from pymatgen.analysis.phase_diagram import PDEntry, PhaseDiagram
from pymatgen.core import Composition, Element

LARGEST = 12
TERNARY = ("Al", "Fe", "Ni"), ("Al", "Co", "Ni"), ("Cu", "Ni", "Sn")


def compounds():
    shipped = Path(pymatgen.analysis.compatibility.__file__).parent / "exp_compounds.json.gz"
    for compound in json.loads(gzip.decompress(shipped.read_bytes())):
        yield Composition(compound["formula"]), compound["exp energy"]


def judged(elements, entries):
    diagram = PhaseDiagram([*(PDEntry(element, 0.0) for element in elements), *entries])
    rows = [
        {
            "formula": entry.composition.reduced_formula,
            "shares": [entry.composition.get_atomic_fraction(Element(element)) for element in elements],
            "energy": entry.energy_per_atom,
            "above": diagram.get_e_above_hull(entry),
            "stable": entry in diagram.stable_entries,
        }
        for entry in diagram.all_entries
    ]
    return {"elements": elements, "entries": rows}


def main():
    known = list(compounds())
    systems = Counter(tuple(sorted(map(str, composition))) for composition, _ in known)
    largest = [elements for elements, _ in systems.most_common() if len(elements) == 2][:LARGEST]
    result = []
    for elements in (*largest, *TERNARY):
        inside = [PDEntry(c, energy) for c, energy in known if set(map(str, c)) <= set(elements)]
        result.append(judged(elements, inside))
    dice = random.Random(8)
    made_up = [PDEntry({"Li": dice.randint(0, 12), "O": dice.randint(1, 12)}, dice.uniform(-9, 3)) for _ in range(80)]
    result.append(judged(("Li", "O"), made_up))
    print(json.dumps({"pymatgen": importlib.metadata.version("pymatgen"), "systems": result}, indent=1))


if __name__ == "__main__":
    main()
