"""The engine: drives the core with threads and the event loop, and serves callers that wait and watch. Without gRPC."""
