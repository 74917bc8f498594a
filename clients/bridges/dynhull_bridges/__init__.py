"""Bridges between dynhull and other systems: `dynhull relay` delivers the events of fences."""
