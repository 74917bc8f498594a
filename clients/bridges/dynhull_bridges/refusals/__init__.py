"""What the refusals of each broker and receiver mean: a table each, all of the same form."""
