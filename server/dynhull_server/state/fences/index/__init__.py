"""Who is inside of fences, and what a change of hulls moves."""
