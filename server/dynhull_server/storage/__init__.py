"""Where hulls are kept: the port, and its implementations in memory and on SQLite."""
