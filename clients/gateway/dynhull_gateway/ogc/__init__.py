"""OGC API - Features, part 1: Core 1.0.1 (OGC 17-069r4): geographic hulls and their entities for maps."""
