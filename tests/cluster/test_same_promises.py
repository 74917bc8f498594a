"""Tests of the server, run against two gateways and two workers. `make workers` runs all; these are in `make test`."""

import importlib.util
import re
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from types import ModuleType

import pytest
from server_process import SHAPES, server_process

from dynhull_client import HullClient, HullUnsuitableError, InvalidRequestError
from dynhull_cluster.placement import worker_of

FOLDER = Path(__file__).parents[1] / "server"


def loaded(name: str) -> ModuleType:
    path = FOLDER / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"against_workers_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


fixtures, alarms, hulls, query, resume, stream, watch = map(
    loaded,
    (
        "conftest",
        "alarms/test_alarms",
        "writes/test_hulls",
        "reads/test_query",
        "watches/test_resume",
        "writes/test_stream",
        "watches/test_watch",
    ),
)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with server_process(*SHAPES["workers"]) as server:
        yield server.address


@pytest.fixture
def name(request: pytest.FixtureRequest) -> str:
    """A hull name whose continuations are at its worker."""
    return re.sub(r"\W+", "-", request.node.name) + "/h"


channel, stub, client, hull = fixtures.channel, fixtures.stub, fixtures.client, fixtures.hull
filled = query.filled

test_an_alarm_is_raised_and_cleared = alarms.test_an_alarm_is_raised_and_cleared_with_hysteresis
test_consumers_of_alarms_have_their_places = alarms.test_consumers_have_their_places
test_what_a_batch_did = hulls.test_what_a_batch_did
test_an_ingest_answers_once = hulls.test_an_ingest_answers_once
test_pages = hulls.test_pages
test_a_deleted_hull_is_gone_and_its_name_free = hulls.test_a_deleted_hull_is_gone_and_its_name_free
test_every_kind_of_read = query.test_every_kind_of_read_is_answered_as_its_own_method_does
test_a_refused_read_ends_nothing = query.test_a_refused_read_has_the_error_of_its_own_method_and_ends_nothing
test_a_resumed_watch_begins_with_what_has_changed = resume.test_a_resumed_watch_begins_with_what_has_changed
test_another_hull_of_the_name_is_not_gone_on_with = resume.test_another_hull_of_the_name_is_not_gone_on_with
test_a_refused_batch_ends_the_stream = stream.test_a_refused_batch_ends_the_stream_after_the_acknowledgements_before_it
test_a_message_has_several_batches = stream.test_a_message_has_several_batches_and_a_response_several_results
test_a_gap_is_refused_with_the_number_expected = stream.test_a_gap_is_refused_with_the_number_expected
test_removed_and_added_stand_in_boundary_order = watch.test_removed_and_added_stand_in_boundary_order
test_progress_while_quiet = watch.test_progress_while_quiet
test_a_deleted_hull_ends_its_watches = watch.test_a_deleted_hull_ends_its_watches


def test_an_alarm_is_with_the_worker_of_its_hulls(client: HullClient, name: str) -> None:
    client.create_hull(name)
    apart = next(
        f"elsewhere-{number}" for number in count() if worker_of(f"elsewhere-{number}", 2) != worker_of(name, 2)
    )
    with pytest.raises(HullUnsuitableError) as refused:
        client.create_alarm(apart, hull=name, when="area > 1")
    assert refused.value.reason == "HULLS_APART"
    client.create_hull(apart)
    for alarm, hulls in ((name, {"hull": name}), (f"{name}/near", {"prefix": f"{name}/"})):
        with pytest.raises(HullUnsuitableError, match=apart) as refused:
            client.create_alarm(alarm, **hulls, when=f"near {apart} 5")
        assert refused.value.reason == "HULLS_APART"
    with pytest.raises(InvalidRequestError, match='a prefix has a "/"'):
        client.create_alarm(name, prefix="all", when="area > 1")
    for each in (name, apart):
        client.create_alarm(each, prefix=f"{each}/", when="area > 1")
    assert {name, apart} <= {each.name for each in client.list_alarms()}
    assert [each.name for each in client.list_alarms(apart)] == [apart]
