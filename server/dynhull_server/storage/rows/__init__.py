"""Hulls and fences as rows of tables: what the storages on databases share.

The tables and their columns (`tables`), the bytes in them (`encoding`, `chunks`, `event_blocks`), which rows there are
(`ledger`, `fence_ledger`), reading and examining them. What a database does with them is its own: transactions, files,
connections and migrations.

How damage is detected. Each row has a checksum of its content and of its keys. The row `totals` has the number of all
valid rows and the sum of their checksums, updated in each commit, so that a missing row is noticed. The row numbers of
each hull are read from the tables when the storage is opened, and kept in memory: no index decides what there is.
"""
