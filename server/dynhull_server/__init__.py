"""The dynhull server: named hulls behind the gRPC service dynhull.v1.HullService."""

import os

# gRPC's core would tell standard error of every failed handshake, in lines of its own form. Read when grpc is imported.
os.environ.setdefault("GRPC_VERBOSITY", "ERROR")
