"""The command line: `dynhull`."""

import os

# gRPC would print lines of its own about a connection that fails. It reads this when it is imported.
os.environ.setdefault("GRPC_VERBOSITY", "ERROR")
