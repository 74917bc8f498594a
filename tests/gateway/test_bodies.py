"""Bodies of rows: what is applied, once, and what a bad body is answered with."""

import http.client
import json
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlencode

import numpy as np
import pytest
from gateway_process import CSV, GEOJSON, NDJSON, Gateway, gateway_process
from patience import wait_until
from server_process import server_process

SEQUENCE = "application/geo+json-seq"
ROWS = 20_000


def lines(start: int, stop: int) -> bytes:
    return b"".join(b"[%d, %d]\n" % (number, number * number % 1009) for number in range(start, stop))


def size(gateway: Gateway, name: str) -> int:
    return gateway.get(f"/hulls/{name}").json["info"]["points"]


@pytest.fixture
def plane(gateway: Gateway, name: str) -> str:
    gateway.post("/hulls", {"name": name})
    return name


@pytest.fixture
def keyed(gateway: Gateway, name: str) -> str:
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    return name


FEATURE = '{"type": "Feature", "id": "a", "geometry": {"type": "Point", "coordinates": [1, 2, 3]}, "properties": {}}'
LINES = (
    b'{"key": "a", "x": 1, "y": 2, "time": "2026-01-01T00:00:00Z"}\r\n\r\n'
    b'{"key": "b", "lon": 3, "lat": 4, "time": "2026-01-01T00:00:00+01:00"}'
)
BODIES = [
    (NDJSON, LINES, {"a": [1, 2], "b": [3, 4]}),
    (CSV, "\ufeffname,lat,key,lon\nA,2,a,1\nB,4,b,3\n".encode(), {"a": [1, 2], "b": [3, 4]}),
    (SEQUENCE, f"\x1e{FEATURE}\n\x1e{FEATURE.replace('[1', '[9')}\n".encode(), {"a": [9, 2]}),
]


@pytest.mark.parametrize(("kind", "body", "expected"), BODIES)
def test_rows_of_each_kind(gateway: Gateway, keyed: str, kind: str, body: bytes, expected: dict[str, object]) -> None:
    done = gateway.post(f"/hulls/{keyed}/rows", body, kind)
    assert (done.status, done.json["rows"]) == (200, 2), done.json
    found = gateway.get(f"/hulls/{keyed}/entities").json
    assert dict(zip(found["keys"], found["points"], strict=True)) == expected


def test_a_collection_and_points_without_keys(gateway: Gateway, plane: str) -> None:
    at = f"/hulls/{plane}/rows"
    collection = f'{{"type": "FeatureCollection", "features": [{FEATURE}, {FEATURE}]}}'
    assert gateway.post(f"{at}?keys=none", collection.encode(), GEOJSON).json["inserted"] == 2
    several = b'{"type": "MultiPoint", "coordinates": [[0, 0], [1, 2]]}'
    assert gateway.post(at, several, GEOJSON).json["inserted"] == 2
    deleted = gateway.post(f"{at}?delete=true", b"[1, 2]\n[1, 2]\n[7, 7]", NDJSON).json
    assert (deleted["deleted"], deleted["missing"]) == (2, 1)
    assert size(gateway, plane) == 2


def test_removing_and_coalescing_keys(gateway: Gateway, keyed: str) -> None:
    at = f"/hulls/{keyed}/rows"
    moves = "".join(json.dumps({"key": f"k{i % 3}", "x": i, "y": 0}) + "\n" for i in range(30)).encode()
    assert gateway.post(at, moves, NDJSON).json["batches"] == 10
    assert gateway.post(f"{at}?coalesce=true", moves, NDJSON).json["batches"] == 1
    found = gateway.get(f"/hulls/{keyed}/entities").json
    assert dict(zip(found["keys"], found["points"], strict=True)) == {"k0": [27, 0], "k1": [28, 0], "k2": [29, 0]}
    assert gateway.post(f"{at}?delete=true", b'{"key": "k0"}\n{"key": "k9"}', NDJSON).json["deleted"] == 1
    assert gateway.post(f"{at}?delete=true", b"key\nk1\n", CSV).json["deleted"] == 1


FEATURES = (
    b'{"type": "FeatureCollection", "features": ['
    b'{"type": "Feature", "geometry": {"type": "MultiPoint", "coordinates": [[0, 0], [1, 1]]}, "properties": null},'
    b'{"type": "Feature", "geometry": {"type": "Point", "coordinates": [null, 1]}, "properties": null}]}'
)
BAD = [
    (NDJSON, b'[1, 2]\n\n{"x": 1, "y": "two"}\n', 400, 1, "y", '"two"'),
    (NDJSON, b'{"x": 1, "y": 2, "time": "2026-01-01T00:00:00"}\n', 400, 0, "time", '"2026-01-01T00:00:00"'),
    (NDJSON, b'{"x": 1, "y": 2, "expires": "2026-01-01T00:00:00Z"}\n', 400, 0, "expires", None),
    (NDJSON, b'[1, 2]\n[1, "2"]\n', 400, 1, "y", '"2"'),
    (NDJSON, b'{"key": "a", "x": 1, "y": 2}\n{"key": 1, "x": 1, "y": 2}\n', 400, 1, "key", None),
    (NDJSON, b'{"key": "a", "x": 1, "y": 2}\n', 409, 0, "key", None),
    (NDJSON, b"[1, 2]\n[1]\n", 400, 1, None, None),
    (NDJSON, b"[1, 2]\n[1, 2\n", 400, 1, None, None),
    (NDJSON, b"[1, NaN]\n", 400, 0, None, None),
    (NDJSON, b"[1, 2]\n\xff\xfe\n", 400, 1, None, "\\xff\\xfe"),
    (NDJSON, b'{"key": "a", "x": 1, "y": 2}\n[1, 2]\n', 400, 1, "key", None),
    (NDJSON, b"[" + b"1" * 2**21, 400, 0, None, None),
    (CSV, b"x,y\n1,2\n1,inf\n", 400, 1, "y", "inf"),
    (CSV, b"x,y\n1,2\n1,1_000\n", 400, 1, "y", "1_000"),
    (CSV, b"x,y\n1,2\n1\n", 400, 1, None, "1"),
    (CSV, b"x,y\n1,2\n9007199254740993,1\n", 400, 1, "x", "9007199254740993"),
    (NDJSON, b"[1e300, 2]\n[1, 9007199254740993]\n", 400, 1, "y", "9007199254740993"),
    (NDJSON, b'{"x": 1, "y": 2}\n{"x": -9007199254740993, "y": 2}\n', 400, 1, "x", "-9007199254740993"),
    (CSV, b"x,y\n1,2\n1,5,2,5\n", 400, 1, None, "1,5,2,5"),
    (CSV, b"a,b\n1,2\n", 400, 0, "header", None),
    (CSV, b"x;y\n1;2\n", 400, 0, "header", "x;y"),
    (CSV, b"x,x,y\n1,2,3\n", 400, 0, "header", "x,x,y"),
    (CSV, b'x,y\n1,"2\n', 400, 0, None, '1,"2'),
    (CSV, b"x,y\n1,2\n\xff,1\n", 400, 1, None, "\\xff,1"),
    (CSV, b'x,"y\n1,2\n', 400, 0, None, 'x,"y'),
    (GEOJSON, b'{"type": "Polygon", "coordinates": []}', 400, 0, None, None),
    (GEOJSON, b'{"type": "Point", "coordinates": [1, "2"]}', 400, 0, "/coordinates/1", '"2"'),
    (GEOJSON, FEATURES, 400, 2, "/features/1/geometry/coordinates/0", "null"),
    (SEQUENCE, b'\x1e{"type": "Point", "coordinates": [1, 2]}\n\x1e{"type": "Poi', 400, 1, None, None),
    ("text/csv; charset=utf-16", "x,y\n1,2\n".encode("utf-16"), 415, None, "Content-Type", None),
    ("application/pdf", b"%PDF", 415, None, "Content-Type", "application/pdf"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "body", "status", "row", "field", "value"), BAD)
def test_bad_bodies_name_the_row_and_change_nothing(
    gateway: Gateway, plane: str, kind: str, body: bytes, status: int, row: int, field: str | None, value: str | None
) -> None:
    refused = gateway.post(f"/hulls/{plane}/rows", body, kind)
    said = refused.json
    assert (refused.status, said.get("row")) == (status, row), said
    assert field is None or said["field"] == field
    assert value is None or said["value"] == value
    assert gateway.get(f"/hulls/{plane}").json["info"]["revision"] == 0


def test_rows_that_a_keyed_hull_refuses_are_numbered(gateway: Gateway, keyed: str) -> None:
    at = f"/hulls/{keyed}/rows"
    refused = gateway.post(at, b"[1, 2]\n[3, 4]\n", NDJSON).json
    assert (refused["status"], refused["row"], refused["reason"]) == (409, 0, "HULL_UNSUITABLE")
    assert "has keys, which are strings" in refused["detail"]
    assert '{"key": KEY, "x": X, "y": Y}' in refused["detail"]


def test_rows_keep_their_numbers_when_a_key_comes_again(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str", "geographic": True})
    rows = b"".join(b'{"key": "%s", "lon": 0, "lat": %d}\n' % row for row in ((b"a", 0), (b"a", 1), (b"b", 95)))
    refused = gateway.post(f"/hulls/{name}/rows?coalesce=true", rows, NDJSON).json
    assert (refused["status"], refused["row"], refused["value"]) == (400, 2, "[0.0, 95.0]"), refused


def test_compressed_bodies_are_refused(gateway: Gateway, plane: str) -> None:
    refused = gateway.post(f"/hulls/{plane}/rows", b"\x1f\x8b", NDJSON, Content_Encoding="gzip")
    assert (refused.status, refused.json["field"]) == (415, "Content-Encoding")


def test_a_slow_body_is_given_up(hasty: Gateway, gateway: Gateway, plane: str) -> None:
    """What came before is not applied as a part of a batch."""
    for path, kind in (("rows", NDJSON), ("points", "application/json"), ("locate", "application/json")):
        connection = hasty.connection()
        connection.putrequest("POST", f"/hulls/{plane}/{path}")
        connection.putheader("Content-Type", kind)
        connection.putheader("Content-Length", "100")
        connection.endheaders(b"[1, 2]\n[3,")
        assert connection.getresponse().status == 408
        connection.close()
    assert size(gateway, plane) == 0


def test_half_a_body_is_nothing_to_log(gateway: Gateway, plane: str) -> None:
    """The gateway may log nothing: see `gateway_process`."""
    for path in ("points", "locate", "rows"):
        connection = gateway.connection()
        connection.putrequest("POST", f"/hulls/{plane}/{path}")
        connection.putheader("Content-Type", NDJSON if path == "rows" else "application/json")
        connection.putheader("Content-Length", "100")
        connection.endheaders(b"[[1, 2],")
        connection.close()
    assert size(gateway, plane) == 0
    missing = gateway.get(f"/{'a' * 60_000}")
    assert (missing.status, len(missing.body) < 1000) == (404, True)


def test_of_half_a_body_whole_batches_are_applied_and_the_rest_can_follow(gateway: Gateway, plane: str) -> None:
    body = lines(0, ROWS)
    connection = gateway.connection()
    connection.putrequest("POST", f"/hulls/{plane}/rows")
    connection.putheader("Content-Type", NDJSON)
    connection.putheader("Idempotency-Key", "half:1")
    connection.putheader("Content-Length", str(len(body)))
    connection.endheaders(body[: len(body) // 2])
    wait_until(lambda: size(gateway, plane) == 8192)
    connection.close()
    done = gateway.post(f"/hulls/{plane}/rows", body, NDJSON, Idempotency_Key="half:1").json
    assert (done["rows"], done["repeated"], done["last_sequence"]) == (ROWS, 8192, ROWS)
    assert size(gateway, plane) == ROWS
    rest = gateway.post(f"/hulls/{plane}/rows", b"[1, 1]\n", NDJSON, Idempotency_Key=f"half:{ROWS + 1}")
    assert (rest.status, size(gateway, plane)) == (200, ROWS + 1)
    gap = gateway.post(f"/hulls/{plane}/rows", b"[1, 1]\n", NDJSON, Idempotency_Key=f"half:{ROWS + 9}")
    assert (gap.status, gap.json["expected"]) == (409, ROWS + 2)


def test_a_body_that_stalls_is_answered_when_the_gateway_ends(address: str, name: str) -> None:
    with gateway_process(address, "--grace", "1s", complaints="graceful shutdown exceeded") as gateway:
        gateway.post("/hulls", {"name": name})
        connection = gateway.connection()
        connection.putrequest("POST", f"/hulls/{name}/rows")
        connection.putheader("Content-Type", NDJSON)
        connection.putheader("Content-Length", "1000000")
        connection.endheaders(lines(0, ROWS))
        wait_until(lambda: size(gateway, name) >= 8192)
        gateway.process.terminate()
        response = connection.getresponse()
        assert (response.status, json.loads(response.read())["reason"]) == (503, "DRAINING")
        connection.close()


def test_an_error_late_in_a_body_says_how_many_rows_were_applied(gateway: Gateway, plane: str) -> None:
    refused = gateway.post(f"/hulls/{plane}/rows", lines(0, 3 * ROWS) + b"[1, null]\n", NDJSON).json
    assert refused["row"] == 3 * ROWS
    assert size(gateway, plane) == refused["applied"] > 0


def test_nothing_is_lost_or_doubled_when_the_server_is_killed(tmp_path) -> None:
    """A body is sent again with its key until it is acknowledged, over kills of the server and of the gateway."""
    body = lines(0, ROWS)
    killed_at = iter([1, 2, 3])
    port = "0"
    attempts = 0
    done = None
    while done is None:
        attempts += 1
        kill = next(killed_at, None)
        with (
            server_process("--data", str(tmp_path), "--port", port, killed=kill is not None, torn=True) as server,
            gateway_process(server.address) as gateway,
        ):
            gateway.post("/hulls", {"name": "h", "exist_ok": True})

            def parts(kill: int | None = kill, server=server) -> Iterator[bytes]:
                step = len(body) // 4
                for number in range(4):
                    if number == kill:
                        server.process.kill()
                    yield body[number * step : (number + 1) * step if number < 3 else None]

            try:
                answer = gateway.post("/hulls/h/rows", parts(), NDJSON, Idempotency_Key="killed:1")
                done = answer.json if answer.status == 200 else None
                assert answer.status in (200, 503), answer.json
            except (http.client.HTTPException, OSError):
                done = None
            if done is not None:
                with_client = gateway.get("/hulls/h").json["info"]
                assert (with_client["points"], with_client["distinct"]) == (ROWS, ROWS)
    assert attempts > 1
    assert done["last_sequence"] == ROWS
    assert np.isfinite(done["repeated"])


UNIX = 1767225600  # 2026-01-01T00:00:00Z
GRAMMAR = [
    (NDJSON, b'{"key": "a", "longitude": 1, "latitude": "2", "time": %d, "speed": 7}' % UNIX),
    (NDJSON, b'{"key": "a", "lng": 1, "lat": 2, "time": %d000, "deep": {"x": 1}}' % UNIX),
    (NDJSON, b'{"key": "a", "Easting": 1, "Northing": 2, "time": "2026-01-01T01:00:00+01:00"}'),
    (NDJSON, f'{{"type": "Feature", "id": "a", "geometry": {{"type": "Point", "coordinates": [1, 2]}}, "properties": '
     f'{{"time": {UNIX}}}}}'.encode()),
    (CSV, b"key,lng,lat,time,speed\na,1,2,%d,7\n" % UNIX),
    (CSV, b"key,long,lat,time\na, 1,2 ,2026-01-01 00:00Z\n"),
    (CSV, b"key,long,lat,time\na,1,2,2025-12-31T23:59:60Z\n"),
    (NDJSON, b'{"key": "a", "lon": 1, "lat": 2, "time": "2025-12-31t23:59:60z"}'),
    (SEQUENCE, FEATURE.replace('"properties": {}', f'"properties": {{"time": {UNIX}.0}}').encode()),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "body"), GRAMMAR)
def test_a_row_is_read_alike_in_every_kind_of_body(gateway: Gateway, keyed: str, kind: str, body: bytes) -> None:
    done = gateway.post(f"/hulls/{keyed}/rows", body, kind)
    assert (done.status, done.json.get("inserted")) == (200, 1), done.json
    found = gateway.get(f"/hulls/{keyed}/entities").json
    assert (found["keys"], found["points"], found["times"]) == (["a"], [[1, 2]], ["2026-01-01T00:00:00.000000Z"])


def test_times_without_a_time_zone_are_read_as_the_call_says(gateway: Gateway, keyed: str) -> None:
    def upload(time: str, **query: str) -> Any:
        body = f"key,x,y,time\na,1,2,{time}\n".encode()
        return gateway.post(f"/hulls/{keyed}/rows?{urlencode(query)}", body, CSV).json

    assert "or an offset, or name it with time_zone" in upload("2026-03-01 12:00")["detail"]
    berlin = {"time_zone": "Europe/Berlin"}
    for time, query, told in (
        ("2026-03-01 12:00", berlin, "2026-03-01T11:00:00.000000Z"),
        ("2026-10-25 02:30", berlin | {"ambiguous": "later"}, "2026-10-25T01:30:00.000000Z"),
        ("01/02/2026 12:00", berlin | {"time_format": "%d/%m/%Y %H:%M"}, "2026-02-01T11:00:00.000000Z"),
    ):
        assert "detail" not in upload(time, **query)
        assert gateway.get(f"/hulls/{keyed}/entities").json["times"] == [told]
    twice = upload("2026-10-25 02:30", **berlin)
    assert (twice["field"], "exists twice in Europe/Berlin" in twice["detail"]) == ("time", True), twice
    assert "; ambiguous says which moment it is" in twice["detail"]
    for query, field in (
        ({"time_zone": "Mars/Base"}, "time_zone"),
        ({"ambiguous": "later"}, "ambiguous"),
        ({"time_format": "%s"}, "time_format"),
    ):
        assert (upload("2026-03-01", **query)["field"], upload("2026-03-01", **query)["status"]) == (field, 400)


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        (NDJSON, b'{"lon": 1, "lat": 2}\n{"lon": 181, "lat": 91}\n{"longitude": "181", "latitude": "91"}\n[181, 91]\n'),
        (CSV, b"lon,lat\n1,2\n181,91\n181.0,91.0\n3,90.5\n"),
    ],
)
def test_what_ais_has_not_is_a_bad_row_of_a_plane_too(gateway: Gateway, plane: str, kind: str, body: bytes) -> None:
    done = gateway.post(f"/hulls/{plane}/rows?max_bad=2", body, kind).json
    assert (done["inserted"], [each["row"] for each in done["bad"]]) == (2, [1, 2])
    assert {each["detail"] for each in done["bad"]} == {"which AIS writes where it is not available"}


def test_rows_say_when_keys_leave_and_which_keys_are_put(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str", "max_age": 86400, "clock": "data"})
    at = f"/hulls/{name}/rows"
    rows = f"key,x,y,time,expires\na,0,0,{UNIX},{UNIX + 5}\nb,1,1,{UNIX},{UNIX + 50}\n"
    assert gateway.post(f"{at}?time_unit=s", rows.encode(), CSV).json["inserted"] == 2
    more = f"key,x,y,time\nb,9,9,{UNIX}\nc,2,2,{UNIX}\n"
    done = gateway.post(f"{at}?only=absent&ttl=20", more.encode(), CSV).json
    assert (done["inserted"], done["skipped"]) == (1, 1)
    gateway.post(at, f"key,x,y,time\nd,3,3,{UNIX + 10}\n".encode(), CSV)
    assert gateway.get(f"/hulls/{name}/entities").json["keys"] == ["b", "c", "d"]
    gateway.post(at, f"key,x,y,time\nd,3,3,{UNIX + 30}\n".encode(), CSV)
    assert gateway.get(f"/hulls/{name}/entities").json["keys"] == ["b", "d"]
    wrong = gateway.post(f"{at}?ttl=20", b"x,y\n1,2\n", CSV)
    assert (wrong.status, "ttl" in wrong.json["detail"]) == (400, True)


def test_rows_and_batches_have_accuracies(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    at, known = f"/hulls/{name}/rows", f"/hulls/{name}/entities"
    assert gateway.post(at, b"key,x,y,accuracy\na,0,0,1.5\nb,1,1,\n", CSV).json["inserted"] == 2
    more = b'{"key": "c", "x": 1, "y": 2, "accuracy": 2}\n{"key": "d", "x": 1, "y": 3, "accuracy": -1}\n'
    done = gateway.post(f"{at}?max_bad=1", more, NDJSON).json
    assert [(each["row"], each["field"], each["value"]) for each in done["bad"]] == [(1, "accuracy", "-1")]
    assert gateway.get(known).json["accuracies"] == [1.5, 0, 2]
    wrong = gateway.post(at, b'{"x": 1, "y": 2, "accuracy": 3}\n', NDJSON)
    assert (wrong.status, wrong.json["field"]) == (400, "accuracy")
    put = {"keys": ["a", "b"], "points": [[0, 0], [1, 1]], "accuracies": [0, 4]}
    assert gateway.post(f"/hulls/{name}/points", put).status == 200
    assert gateway.get(known).json["accuracies"] == [0, 4, 2]
    for bad, place in [([1], "accuracies"), ([1, -1], "accuracies"), ([1, "2"], "accuracies")]:
        refused = gateway.post(f"/hulls/{name}/points", put | {"accuracies": bad})
        assert (refused.status, refused.json["field"]) == (400, place)
    fence = {"name": name, "area": {"center": [0, 0], "radius": 9}, "subjects": name, "by_accuracy": True}
    expected = {"expected": ["a", "z"], "expected_by": "18:00 Europe/Berlin mon-fri"}
    made = gateway.post("/fences", fence | expected).json
    assert {each: made[each] for each in expected} == expected
    assert made["by_accuracy"] is True
    refused = gateway.post("/fences", fence | {"name": f"{name}2", "expected": ["a"], "expected_by": "noon"})
    assert (refused.status, refused.json["field"]) == (400, "expected_by")
    both = gateway.post("/fences", fence | {"name": f"{name}2", "expected_within": 5} | expected)
    assert (both.status, "expected_by or expected_within" in both.json["detail"]) == (400, True)


def test_a_row_of_the_distant_future_is_a_bad_row_without_a_window_too(gateway: Gateway, name: str) -> None:
    made = gateway.post("/hulls", {"name": name, "keyed": "str", "max_skew": 60, "ordering": "event_time"})
    assert (made.json["window"]["max_age"], made.json["window"]["max_skew"]) == (None, 60)
    rows = b"key,x,y,time\na,1,2,2099-01-01T00:00Z\na,3,4,2026-01-01T00:00Z\n"
    done = gateway.post(f"/hulls/{name}/rows?max_bad=1", rows, CSV).json
    (bad,) = done["bad"]
    assert (done["inserted"], bad["row"], "further ahead of the server's clock" in bad["detail"]) == (1, 0, True)
    refused = gateway.post("/hulls", {"name": f"{name}/b", "keyed": "str", "max_skew": 60})
    assert (refused.status, refused.json["field"]) == (400, "max_skew"), refused.json
    assert "ordering event_time or max_age or max_points" in refused.json["detail"]


@pytest.mark.parametrize("numbered", [False, True])
def test_bad_rows_are_left_out_as_far_as_they_may_be(gateway: Gateway, name: str, numbered: bool) -> None:
    """Rows that cannot be read, that are not like the others, and that the server refuses: in each of three batches."""
    gateway.post("/hulls", {"name": name, "geographic": True, "center": [0, 0]})
    lines = [b"[%d, %d]" % (number % 60, number % 61) for number in range(ROWS)]
    bad = {
        0: b"[178, 0]",
        7: b"[1",
        8191: b"[0, 91]",
        9000: b'{"key": "a", "x": 1, "y": 2}',
        9001: b"[90, 0]",
        ROWS - 1: b"7",
    }
    for row, line in bad.items():
        lines[row] = line
    at, body = f"/hulls/{name}/rows", b"\n".join(lines)
    header = {"Idempotency_Key": "bad:1"} if numbered else {}
    short = gateway.post(f"{at}?max_bad=2", body, NDJSON, **header).json
    assert (short["status"], short["row"], short["applied"]) in [(400, 8191, 0), (400, 9000, 0)]
    done = gateway.post(f"{at}?max_bad=6", body, NDJSON, **header).json
    assert (done["rows"], done["inserted"], done["bad_rows"], done["batches"]) == (ROWS, ROWS - 6, 6, 3)
    assert sorted(each["row"] for each in done["bad"]) == sorted(bad)
    assert {each["row"]: each["value"] for each in done["bad"]}[8191] == "[0.0, 91.0]"
    assert all(each["detail"] for each in done["bad"])
    if numbered:
        again = gateway.post(f"{at}?max_bad=6", body, NDJSON, **header).json
        assert (again["repeated"], again["inserted"], again["last_sequence"]) == (ROWS, 0, ROWS)
        rest = gateway.post(f"{at}?max_bad=1", b"[178, 0]", NDJSON, Idempotency_Key=f"bad:{ROWS + 1}").json
        assert (rest["bad_rows"], rest["inserted"]) == (1, 0)
        last = gateway.post(at, b"[1, 1]", NDJSON, Idempotency_Key=f"bad:{ROWS + 2}").json
        assert (last["rows"], last["inserted"]) == (1, 1), "a batch of bad rows has its number, too"
    assert size(gateway, name) == ROWS - 6 + numbered


def test_bad_features_are_left_out(gateway: Gateway, plane: str) -> None:
    done = gateway.post(f"/hulls/{plane}/rows?max_bad=1", FEATURES, GEOJSON).json
    assert (done["rows"], done["inserted"], done["bad_rows"]) == (3, 2, 1)
    (bad,) = done["bad"]
    assert (bad["row"], bad["field"]) == (2, "/features/1/geometry/coordinates/0")
