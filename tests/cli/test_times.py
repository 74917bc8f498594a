"""Times as people have them: without a time zone, day first, leap seconds, hours that clocks repeat or skip."""

import json

import pytest
from command_line import dynhull

from dynhull_client import HullClient

BERLIN = "--time-zone", "Europe/Berlin"
DAY_FIRST = "--time-format", "%d/%m/%Y %H:%M:%S"
READ = {
    (): {
        "2016-12-31T23:59:60Z": "2017-01-01T00:00:00",
        "2016-12-31T23:59:60.25Z": "2017-01-01T00:00:00.250000",
        "2016-12-31t23:59:60z": "2017-01-01T00:00:00",
        "2017-01-01T01:59:60+02:00": "2017-01-01T00:00:00",
    },
    BERLIN: {
        "2026-03-01 12:00:00": "2026-03-01T11:00:00",
        "2026-07-01T12:00": "2026-07-01T10:00:00",
        "2026-07-01": "2026-06-30T22:00:00",
        "2026-07-01T12:00Z": "2026-07-01T12:00:00",
        "2017-01-01 00:59:60": "2017-01-01T00:00:00",
    },
    (*BERLIN, "--ambiguous", "earlier"): {
        "2026-03-29 02:30:00": "2026-03-29T00:30:00",
        "2026-10-25 02:30:00": "2026-10-25T00:30:00",
    },
    (*BERLIN, "--ambiguous", "later"): {
        "2026-03-29 02:30:00": "2026-03-29T01:30:00",
        "2026-10-25 02:30:00": "2026-10-25T01:30:00",
    },
    (*DAY_FIRST, *BERLIN): {
        "01/02/2026 12:00:00": "2026-02-01T11:00:00",
        "01/01/2017 00:59:60": "2017-01-01T00:00:00",
    },
    ("--time-format", "%Y%m%d%H%M%S%z"): {
        "20260201120000+0100": "2026-02-01T11:00:00",
        "20170101005960+0100": "2017-01-01T00:00:00",
    },
}
REFUSED = {
    (): {
        "2026-03-01 12:00": "without a time zone: add Z for UTC, or an offset, or name it with --time-zone",
        "01/02/2026 12:00:00": "neither ISO 8601 with a time zone nor a number; --time-format reads other forms",
        "2016-12-31T23:59:61Z": "neither ISO 8601",
        "9999-12-31T23:59:60Z": "neither ISO 8601",
    },
    BERLIN: {
        "2026-03-29 02:30": "does not exist in Europe/Berlin: clocks were put forward; --ambiguous says which moment",
        "2026-10-25 02:30": "exists twice in Europe/Berlin: clocks were put back; --ambiguous says which moment",
        "1600-01-01": "not from the years 1685 to 2255",
    },
    (*DAY_FIRST, *BERLIN): {
        "12/31/2026 12:00:00": "not of the form %d/%m/%Y %H:%M:%S",
        "2026-03-01T12:00:00Z": "not of the form",
    },
    DAY_FIRST: {"31/12/2026 12:00:00": "without a time zone"},
}
WRONG = {
    ("--time-zone", "Mars/Base"): "--time-zone is 'Mars/Base', no time zone of the IANA database",
    ("--time-zone", "Europe"): "--time-zone is 'Europe', no time zone",
    ("--ambiguous", "later"): "--ambiguous is given with --time-zone",
    ("--time-format", "%H:%M"): "does not say year, month and day",
    ("--time-format", "%s"): "not a form of times",
    ("--time-format", "%d/%m/%Y %d"): "not a form of times",
    ("--time-format", "%d/%m/%Y %Z"): "names of time zones (%Z) cannot be read",
    ("--time-format", "%d/%m/%Y", "--time-unit", "s"): "--time-format is given without --time-unit",
}


@pytest.fixture
def load(name, tmp_path):
    def run(times, *options):
        file = tmp_path / "seen.csv"
        rows = "".join(f"{time},{row},{row},{time}\n" for row, time in enumerate(times))
        file.write_text(f"id,x,y,seen\n{rows}")
        return dynhull("load", name, file, "--key", "id", "--time", "seen", *options)

    return run


@pytest.mark.parametrize("options", READ, ids=" ".join)
def test_times_are_read(served, name, load, options):
    dynhull("create", name, "--keyed", "str", "--event-order")
    done = load(READ[options], *options)
    assert (done.exit_code, done.stderr) == (0, f"the hull '{name}' already exists: adding to it\n")
    with HullClient(served) as client:
        there = client.entities(name)
    told = dict(zip(there.keys, (each.item().isoformat() for each in there.times), strict=True))
    assert told == READ[options]


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize("options", REFUSED, ids=" ".join)
def test_times_are_refused_with_what_helps(load, options):
    done = load(["2026-03-01T12:00:00Z", *REFUSED[options]], *options, "--dry-run")
    for line, (time, words) in enumerate(REFUSED[options].items(), start=3):
        assert f"line {line}: seen is '{time}', {words}" in done.stderr


@pytest.mark.parametrize("options", WRONG, ids=" ".join)
def test_what_is_wrong_is_said_before_the_file_is_read(name, options):
    done = dynhull("load", name, "nowhere.csv", "--key", "id", "--time", "seen", *options, "--dry-run")
    assert (done.exit_code, WRONG[options] in done.stderr) == (2, True), done.stderr


@pytest.mark.usefixtures("served")
def test_members_of_json_and_times_to_leave_are_read_alike(name, tmp_path):
    rows = [{"id": each, "x": 1, "y": 2, "seen": f"2026-{each} 12:00"} for each in ("03-01", "03-29")]
    file = tmp_path / "seen.ndjson"
    file.write_text("".join(json.dumps(each | {"gone": "2199-07-01 12:00"}) + "\n" for each in rows))
    done = dynhull("load", name, file, "--key", "id", "--time", "seen", "--expires", "gone", *BERLIN)
    assert done.stdout == f"{name}: 2 points loaded, 2 in the hull\n", done.stderr
