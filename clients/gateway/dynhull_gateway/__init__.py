"""HTTP/JSON, server-sent events and OGC API Features in front of a dynhull server."""
