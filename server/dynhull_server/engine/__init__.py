"""The state: named hulls with their revisions and watchers. Knows nothing of gRPC."""
