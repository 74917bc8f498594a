"""The past of hulls: what the journal drops, in Parquet files that nobody changes any more.

A *segment* has the batches of one hull from one revision to another, a row for each point or key of a batch. Beside it
lies the state that its first batch was applied to, if the journal had it, in the same columns. `columns` lays batches
and states out as columns, `parquet` writes and reads these, and `archive` keeps the files: each under a name that is
never used again, with a hash over all of its bytes, which the journal has.
"""
