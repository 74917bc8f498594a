"""`dynhull load`: adds the points of files and pipes to a hull."""
