"""The dynhull server: named hulls and fences behind the gRPC services of dynhull.v1."""

import os

# gRPC's core would log each failed handshake to standard error in its own format. It reads this when imported.
os.environ.setdefault("GRPC_VERBOSITY", "ERROR")
