"""Hulls in a folder: one SQLite database in WAL mode.

How damage is detected. Each row has a checksum of its content and of its keys. The row `totals` has the number of all
valid rows and the sum of their checksums, updated in each commit, so that a missing row is noticed. The tables have no
indexes that could disagree with them: the row numbers of each hull are read from the tables when the storage is opened,
and kept in memory (`ledger`). The log is examined frame by frame before SQLite reads it (`log`), because SQLite
silently drops all frames after a damaged one. `PRAGMA quick_check` checks the structure of the database.
"""
