"""The counts of a batch: what each way to the server says of the rows that were applied."""

from collections.abc import Mapping

# By name, with their meaning. Each is a field of BatchResult and IngestResponse on the wire, of Applied and Ingested in
# the SDK, and of the answers over HTTP; commands say those that are not 0.
COUNTS: Mapping[str, str] = {
    "inserted": "points inserted, with the destinations of moves; in a keyed hull, new keys",
    "deleted": "points deleted, with the origins of moves; in a keyed hull, keys removed",
    "missing": "points to delete or keys to remove that were skipped because the hull did not hold them",
    "moved": "known keys whose position was written",
    "stale": "positions left out because the stored one has a later event time",
    "late": "rows left out because they are too old for the window",
    "skipped": "positions left out because of `only`",
    "clamped": "rows whose event time was too far ahead and was reduced",
    "evicted": "the oldest points, removed because the window has room for no more",
    "held": "positions put into quarantine, because they break a rule of the hull",
    "released": "keys that left the quarantine and were let in: by request, or because their position was confirmed",
    "dropped": "keys whose held position was dropped: by request, contradicted by one that was let in, or removed",
}

# What a command names before the others, in words of its own: "3 points inserted", "3 keys new, 2 moved".
OF_CHANGES = ("inserted", "deleted", "missing", "moved")


def text_of(counts: Mapping[str, int]) -> str:
    """Counts as the continuation of a sentence, ", 5 late, 2 held", without those that are 0."""
    return "".join(f", {count:,} {name}" for name, count in counts.items() if count)
