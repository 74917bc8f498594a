"""Hulls over shards in a server: the I/O around `dynhull_cluster.shards`.

A root runs in the worker that has the name of its hull, and shard i in the worker i places further; in a server of one
process all of them are in that process. Each root and each shard has a thread of its own, because a log is durable when
its method returns. What readers see of a hull over shards is a hull of the engine, which follows the root's decisions:
its log is that of the root. A shard has a row of its own among the hulls of its worker's storage, and a log in the form
of one: the root is a producer there, and the numbers of the steps are its sequence numbers.
"""
