"""The dynhull server: named hulls behind the gRPC service dynhull.v1.HullService."""
