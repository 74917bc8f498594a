"""The disk: batches as they are acknowledged, snapshots of points, and what they make of a restart. Knows no hulls."""
