"""Hulls in a PostgreSQL database, so that they outlive a machine.

The rows and their checksums are those of `dynhull_server.storage.rows`, with the partition that they belong to. A
partition has one owner, with an epoch that rises with each new one (`ownership`): every commit first requires that the
epoch is still its own, so a server that was replaced cannot write any more. Its reads end with its lease.
"""
