"""Incarnations: what a model keeps at a backup, and what must hold of the folder that a restore makes of it.

A restored folder has what the backup has, and lacks what was committed after it. Nobody may take the one for the other:
all hulls and fences have uids that were never given out, and each fence begins anew, with a sequence left out, which is
lost to all, and then who is inside. Writers with numbers from before are refused: see `Model.restored`.
"""

import copy
from dataclasses import replace
from typing import TYPE_CHECKING

from dynhull_server.state.fences.model.records import Cause, Consumer, EventType, KeptFence
from dynhull_server.storage.port import StoredContents

from .fence_model import FenceTruth, same

if TYPE_CHECKING:
    from .model import Model

# What a model knows of the storage. The rest is about requests and answers, which a restore takes back from nobody.
LED_BACK = ("alive", "fences", "consumers", "numbers", "latest", "_hulls", "_uids", "_places", "_numbered")


class Backup:
    """What a model has kept when a backup is made."""

    def __init__(self, model: "Model") -> None:
        self._model = copy.deepcopy(model)

    def restore(self, model: "Model", contents: StoredContents, fences: list[KeptFence]) -> None:
        """Lead a model back to the backup, and compare what is in the folder that was made of it.

        Args:
            model: the model as it is.
            contents: what a server finds in the folder.
            fences: the fences that it finds, each with all of its events.
        """
        former = {*model.uids_ever, *model._uids, *(fence.row.uid for fence in model.fences.ever.values())}
        kept = copy.deepcopy(self._model)
        for name in LED_BACK:
            setattr(model, name, getattr(kept, name))
        model.fences.belong_to(model)
        model.uids_ever = former
        model.forget_answers()
        _compare_hulls(model, contents)
        begun = [fence.row.name for fence in fences]
        if sorted(begun) != sorted(model.fences.alive):
            raise model.finds(f"restored are the fences {begun}, in the backup are {sorted(model.fences.alive)}")
        for fence in fences:
            _begin_anew(model, model.fences.alive[fence.row.name], fence)


def _compare_hulls(model: "Model", contents: StoredContents) -> None:
    """Take over the uids of restored hulls."""
    if sorted(row.name for row in contents.hulls) != sorted(model.alive):
        raise model.finds(f"restored are the hulls {contents.hulls}, in the backup are {sorted(model.alive)}")
    model._uids = {}
    for row in contents.hulls:
        truth = model.alive[row.name]
        if row != replace(truth.row, uid=row.uid):
            raise model.finds(f"restored is {row}, in the backup is {truth.row}")
        _require_new(model, row.name, row.uid)
        truth.row, truth.restored = row, True
        model._uids[row.uid] = truth


def _begin_anew(model: "Model", before: FenceTruth, kept: KeptFence) -> None:
    """Take a restored fence in place of the one of the backup."""
    row, name = kept.row, kept.row.name
    if row != replace(before.row, number=row.number, uid=row.uid) or row.number in model.numbers:
        raise model.finds(f"the fence {name} is restored as number {row.number}, or with other settings")
    _require_new(model, name, row.uid)
    lost = before.last + 1
    expected = model.fences.summary(before, EventType.SNAPSHOT, Cause.CREATED)
    if [event.sequence for event in kept.events] != [lost + 1] or not same(kept.events[0], expected):
        raise model.finds(
            f"the restored fence {name} begins with {kept.events}, and should after {lost} with {expected}"
        )
    consumers = {
        each.name: Consumer(each.name, each.acknowledged, each.lost + lost - max(each.acknowledged, before.first - 1))
        for each in before.consumers.values()
    }
    if (kept.first, kept.consumers) != (lost + 1, consumers):
        raise model.finds(
            f"{name} is restored with {kept.first, kept.consumers}, and should be with {lost + 1, consumers}"
        )
    begun = FenceTruth(row, [*before.events, kept.events[0]._replace(sequence=lost), *kept.events], lost + 1, consumers)
    begun.restored = True
    begun.acknowledged, begun.inside, begun.near = before.acknowledged, before.inside, before.near
    begun.droppable = begun.first
    begun.known, begun.latest = before.known, before.latest
    begun.reads(row)
    before.deleted = model.commits
    model.numbers.add(row.number)
    model.fences.alive[name] = model.fences.ever[row.number] = begun


def _require_new(model: "Model", name: str, uid: str) -> None:
    if uid in model.uids_ever:
        raise model.finds(f"{name} is restored with the uid {uid}, which it had before")
