"""The dynhull server: named hulls behind the gRPC service dynhull.v1.HullService."""

import os

# gRPC's core would log each failed handshake to standard error in its own format. It reads this when imported.
os.environ.setdefault("GRPC_VERBOSITY", "ERROR")
