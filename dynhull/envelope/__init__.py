"""Lower and upper envelopes at work: phase diagrams and efficient frontiers."""

from .frontier import Frontier
from .phases import Decomposition, PhaseDiagram
from .phases_nd import energy_above_hull_nd

__all__ = ["Decomposition", "Frontier", "PhaseDiagram", "energy_above_hull_nd"]
