"""Fences: who is inside of which area, and the events when that changes."""
