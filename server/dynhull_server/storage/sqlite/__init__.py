"""Hulls in a folder: one SQLite database in WAL mode.

The rows and their checksums are those of `storage.rows`. The tables have no indexes that could disagree with them. The
log is examined frame by frame before SQLite reads it (`log`), because SQLite silently drops all frames after a damaged
one. `PRAGMA quick_check` checks the structure of the database.
"""
