"""Where hulls are kept: the port, its implementations in memory and on SQLite, and segments, which have the past."""
