"""Deterministic simulation: random lives of the server in simulated time, with every promise checked by a model.

A run is a plan (`plan`) and a schedule drawn from its seed (`schedule`), and nothing else: the same plan ends the same
way every time. `play` takes a plan through its lives on one storage (`store`), which fails where the plan says so;
`clients` do what it says, and compare each answer with the `model`.

There are five layers. `core_life` drives the core alone, and is several times faster than `shell_life`, which runs the
real engine on a simulated `machine`, either over a storage in memory or over SQLite (`sqlite_store`). `cluster_life`
has several servers, each with a core, that own the hulls of a simulated database one after the other, perhaps with the
past of these in a store that they share (`cluster_past`). `link_life` has the engine behind the link of a gateway, on a
simulated `network`; in some of its plans the engines of several owners, one after the other, with the past of the hulls
in a store that they claim (`link_owners`).

What is found is made small by `shrink`, kept in findings/, and replayed, those of the core by `make test`,
the others by `make slow`. `mutate` tests the test.
"""
