"""`dynhull ingest`: messages of a broker become points of hulls."""
