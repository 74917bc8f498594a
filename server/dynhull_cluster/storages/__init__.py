"""Where the hulls of a server are stored, and what its processes serve there.

`kind.py` is the interface, with a class for each kind of storage: in memory, in a folder, or in a database of the
registry `dynhull_server.storage.databases`. `choice.py` chooses by the settings.
"""
