"""Bridges between dynhull and other systems: `dynhull relay` sends events out, `dynhull ingest` takes messages in."""
