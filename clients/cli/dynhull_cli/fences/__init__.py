"""`dynhull fences`: the fences of a server and their events."""
