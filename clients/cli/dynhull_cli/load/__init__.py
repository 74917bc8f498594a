"""`dynhull load`: the points of files and pipes into a hull."""
