"""Fences: whose keys are inside of an area, and the events of those who enter and leave.

A trip of the core calls its part for fences where hulls have changed; that compares the subjects, and makes the events.

core        what the core calls: the part of a trip, what is published of it, and what is due
model/      a fence: its settings and requests, consumers, delays and stays, and what is counted of it; what is stored
index/      who is inside: the keys of a hull as subjects, areas laid over them, the hulls that share a queue (a line),
            pairs of hulls, and keys that a batch changes or carries from one hull to another
events/     events as columns, from crossings to numbered blocks; the recent ones; whether they follow from each other
trip/       the part of a trip: comparisons, requests to create, replace and delete, consumers, deadlines, delayed
            events, and the leg at one fence
past        a fence after the fact: the events that it would have made of revisions that are applied again
sieve       which of these may make events, where the area never changes: the others are not applied one by one
recovery/   fences as the storage has them, after a start and a failed commit; sides computed again for the scrub

Beside types, each folder uses only those above it; `past` uses those of live fences.
"""
