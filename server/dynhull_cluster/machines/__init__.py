"""Workers and gateways that share a database, and find each other through its tables: of several machines, or of one.

There is no coordinator. Each process reads the same small tables (`board`), and from them each worker works out by the
same rule which partitions it should have (`claims`): it takes those that are free, and lets go of those that another
one should have (`member`). Whoever is mistaken is so in vain, because each partition has an owner with an epoch and a
lease (`postgres.ownership`). Gateways, and hulls over shards, read from the same tables where a partition is
(`addresses`). The command `dynhull cluster split` is, for a while, one of the workers (`split`).
"""
