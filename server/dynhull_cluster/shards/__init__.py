"""One hull over many shards: a root that decides, and shards that hold the points. Pure: no I/O, clocks or threads.

The hull of a union is the hull of the hulls. So the points are divided among shards by a hash, of the key or of the
coordinates; each shard keeps the hull of its own points and reports the vertices that come and go; the root keeps the
hull of those, and answers what depends on the hull alone. The root is the only writer of the hull: it checks and
divides each batch, and decides when all shards have it.

Messages may be lost, doubled or overtaken, and every process may die at any moment:

* The root sends one round of messages at a time, and sends them again until each is answered. A round has a ticket,
  which is never used again. A shard handles each ticket once, keeps its reply, and ignores what is older.
* A round has the batches that wait, as steps. A shard has its steps in its log before it replies; the root has its
  decisions in its own log before it answers the callers. What a shard has logged beyond the root's last decision did
  not happen.
* A refused step, and those behind it, are undone by their inverses where a shard has applied them, before the next
  round, which has the batches behind the refused one again.
* A root begins with an epoch that no root had before. So does it again when a shard has lost its memory: each shard
  goes back to the last decision, says which step and which vertices it has, and ignores earlier epochs from then on,
  also after a restart. If these are not those that were decided, its log is damaged, and the root stops.
"""
