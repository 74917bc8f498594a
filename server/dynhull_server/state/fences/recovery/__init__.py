"""Fences as the storage has them, and as they should be."""
