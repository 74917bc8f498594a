"""Events of fences: made, numbered, kept and checked."""
