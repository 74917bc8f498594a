"""`dynhull demo`: real points through a real server, every step verified."""
