"""The registry of the kinds of databases that hulls can be in."""

from pathlib import Path
from pkgutil import resolve_name

import pytest

from dynhull_cluster.storages.choice import storage_kind
from dynhull_cluster.storages.memory import MemoryKind
from dynhull_server.settings import Settings
from dynhull_server.storage.databases import DATABASES, DatabaseKind, examples, is_database, kind_of


class ElsewhereKind(MemoryKind):
    """Another kind of storage."""


@pytest.fixture
def _elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """A registry with a second kind of database."""
    kind = DatabaseKind("Elsewhere", "elsewhere://host", f"{__name__}:{ElsewhereKind.__name__}")
    monkeypatch.setitem(DATABASES, "elsewhere", kind)


@pytest.mark.usefixtures("_elsewhere")
def test_a_scheme_is_served_by_what_its_line_names() -> None:
    assert isinstance(storage_kind(Settings(journal="elsewhere://host")), ElsewhereKind)
    assert is_database(Path("elsewhere://host"))
    with pytest.raises(ValueError, match="--data is a folder"):
        Settings(data="elsewhere://host")


@pytest.mark.usefixtures("_elsewhere")
def test_an_unknown_scheme_is_answered_with_all_that_there_are() -> None:
    with pytest.raises(ValueError, match=f"write {examples()} ") as refused:
        Settings(journal="mysql://me:secret@host/hulls")
    assert "--journal: mysql:// is no database" in str(refused.value)
    assert examples().endswith(" or elsewhere://host")


@pytest.mark.parametrize("kind", set(DATABASES.values()), ids=lambda kind: kind.name)
def test_each_kind_is_there_and_in_the_help(kind: DatabaseKind) -> None:
    assert {"alone", "shared", "worker", "gateway", "preloads"} <= set(dir(resolve_name(kind.served_by)))
    assert kind.example in str(Settings.model_fields["journal"].description)
    assert kind_of(kind.example) == kind
