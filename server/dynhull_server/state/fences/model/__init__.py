"""A fence as it is and as it is stored."""
