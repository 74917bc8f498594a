"""Hulls in a folder: one SQLite database in WAL mode.

Who believes what. A row carries a checksum of its content and of where it belongs. The row `totals` carries the number
of all rows that count and the sum of their checksums, renewed in each commit, so that a row that vanishes is missed.
There is no index beside the tables that could disagree with them: where a hull's rows lie is read from the tables when
the storage is opened, and kept in memory (`ledger`). The log is examined frame by frame before SQLite reads it (`log`),
because SQLite drops what follows a damaged frame and does not say so; the structure of the database is left to
`PRAGMA quick_check`.
"""
