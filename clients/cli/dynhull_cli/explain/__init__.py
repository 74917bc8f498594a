"""`dynhull explain`: a static algorithm's trace, drawn step by step."""
