"""One server made of several processes: gateways take calls, workers hold the hulls, a supervisor keeps all alive.

A name belongs to a worker: see `placement`. A gateway authenticates callers, reads the name of a request, and passes
the bytes on; what concerns several workers it composes, or refuses. Everything else is the one-process server of
`dynhull_server`, which knows nothing of this package.
"""
