import gc
import os
import re
from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import nullcontext
from itertools import chain, groupby
from pathlib import Path
from random import Random

import divided_shape
import pytest
import server_process as servers
from hypothesis import HealthCheck, Phase, settings
from one_first import one_first
from postgresql import PostgreSQL, postgresql
from server_process import SHAPES, server_process

collect_ignore = ["data/make_phases.py", "mutants/run.py"]  # need packages that the tests do not

# A slow moment of the machine is not a failure, and a change does not fail for examples that came up by chance:
# `make properties` looks for those.
settings.register_profile(
    "dynhull",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    print_blob=True,
    derandomize=True,
    max_examples=30,
)
settings.register_profile("properties", settings.get_profile("dynhull"), derandomize=False, max_examples=1000)
# Each mutant gets the same examples: none that another one has left in the database, and no time spent on shrinking.
settings.register_profile(
    "mutants",
    settings.get_profile("dynhull"),
    derandomize=False,
    max_examples=100,
    phases=[Phase.explicit, Phase.generate],
)
settings.load_profile("dynhull")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--shape", choices=SHAPES, default="process", help="how the servers of the tests run")
    parser.addoption("--order-seed", type=int, help="run the modules, and the tests in each, in a random order")


def pytest_configure(config: pytest.Config) -> None:
    servers.shape = config.getoption("--shape")
    if servers.shape == "shards":
        divided_shape.install()


@pytest.fixture(scope="session")
def address() -> Iterator[str]:
    """A server that tests share; each test uses hulls of its own. It starts and ends as it does for users."""
    with server_process(wrap=["env"]) as server:
        yield server.address


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgreSQL]:
    """A PostgreSQL server that tests share; each test has databases of its own."""
    with postgresql() as server:
        yield server


@pytest.fixture
def name(request: pytest.FixtureRequest) -> str:
    """A hull name of the test's own. Names that begin with it have a worker in common."""
    return re.sub(r"[^A-Za-z0-9]+", "-", request.node.nodeid)[-150:] + ("/h" if servers.shape != "process" else "")


@pytest.hookimpl(wrapper=True)
def pytest_collect_file() -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
    """No docstrings of tests: to look for examples there, every worker would import every file of support twice."""
    found = yield
    return [each for each in found if type(each) is pytest.Module]  # those of docstrings are a subclass


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """In a fresh clone, one worker finds the tests before the others: it compiles, for all, what is imported.

    No collections of garbage meanwhile: they went through all that is imported, again and again.
    """
    gc.disable()
    is_worker = hasattr(session.config, "workerinput")
    is_first_run = not (Path(__file__).parent / "window" / "__pycache__").exists()  # the last folder
    mark = Path(session.config.option.basetemp or "").parent / "found"
    with one_first(mark) if is_worker and is_first_run else nullcontext():
        return (yield)


def pytest_collection_finish() -> None:
    """What is imported stays: collections during the tests need not go through it, and are rarer than by default.

    A tenth of the processor time of the tests went into them.
    """
    gc.freeze()
    gc.enable()
    gc.set_threshold(10_000, 10, 20)


def shuffled(items: list[pytest.Item], seed: int) -> list[pytest.Item]:
    """The items in a random order, those of a module together: they share its fixtures."""
    draw = Random(seed)
    modules = [list(group) for _, group in groupby(items, lambda item: item.path)]
    draw.shuffle(modules)
    for each in modules:
        draw.shuffle(each)
    return [*chain.from_iterable(modules)]


def takes_too_long(item: pytest.Item) -> bool:
    return any(os.environ.get(marker.args[0]) != "all" for marker in item.iter_markers("only_with"))


def some_of_many(items: list[pytest.Item]) -> set[pytest.Item]:
    """The cases that `make long` adds to those of every run."""
    if os.environ.get("LONG_CASES") == "all":
        return set()
    tests: dict[tuple[Path, str], list[pytest.Function]] = {}
    for item in items:
        if item.get_closest_marker("every") and isinstance(item, pytest.Function):
            tests.setdefault((item.path, item.originalname), []).append(item)
    return {item for cases in tests.values() for item in _left_out(cases)}


def _left_out(cases: list[pytest.Function]) -> Iterator[pytest.Function]:
    """All but every n-th case of a test, and those with the first of each value of a parameter that has few."""
    marker = cases[0].get_closest_marker("every")
    assert marker is not None
    values = {value for case in cases for value in case.callspec.indices.items()}
    many = Counter(parameter for parameter, _ in values)
    missing = {(parameter, value) for parameter, value in values if many[parameter] * marker.args[0] <= len(cases)}
    for number, case in enumerate(cases):
        own = set(case.callspec.indices.items())
        if number % marker.args[0] and not own & missing:
            yield case
        missing -= own


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with the long tests: at the end, all workers should have something to do."""
    one_of_many = some_of_many(items)
    if (seed := config.getoption("--order-seed")) is not None:
        items[:] = shuffled(items, seed)
    if left_out := [each for each in items if each in one_of_many or takes_too_long(each)]:
        config.hook.pytest_deselected(items=left_out)  # not skipped: they have a word of their own
        items[:] = [each for each in items if each not in one_of_many and not takes_too_long(each)]
    items.sort(key=lambda item: item.get_closest_marker("long") is None)
    if servers.shape != "process":
        for each in items:
            if marker := each.get_closest_marker("one_process"):
                each.add_marker(pytest.mark.skip(reason=f"about a server of one process: {marker.args[0]}"))
    if servers.shape == "shards":
        for each in items:
            if marker := each.get_closest_marker("whole_hull"):
                each.add_marker(pytest.mark.skip(reason=f"about a hull that is not divided: {marker.args[0]}"))


@pytest.hookimpl(wrapper=True, tryfirst=True)  # after pytest's own summary
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> Iterator[None]:
    """One line for each program that is missing: pytest's own lines are one for each test that a fixture skips."""
    yield
    reasons = [report.longrepr[2] for report in terminalreporter.getreports("skipped")]
    for reason, count in Counter(each for each in reasons if each.startswith("Skipped: no ")).items():
        terminalreporter.write_line(f"{reason}: {count} tests")
