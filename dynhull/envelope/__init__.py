"""Lower and upper envelopes at work: phase diagrams and efficient frontiers."""

from ._frontier import Frontier
from ._phases import Decomposition, PhaseDiagram
from ._phases_nd import energy_above_hull_nd

__all__ = ["Decomposition", "Frontier", "PhaseDiagram", "energy_above_hull_nd"]
