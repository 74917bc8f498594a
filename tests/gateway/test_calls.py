"""Every unary call over HTTP, and what errors say."""

import asyncio
import http.client
import json
import socket
import threading

import numpy as np
import pytest
from application_call import called
from command_line import dynhull
from fastapi.routing import APIRoute
from gateway_process import NDJSON, Gateway, gateway_process
from patience import PATIENCE
from server_process import server_process

from dynhull_client import HullClient
from dynhull_gateway.app import application
from dynhull_gateway.parameters import taken
from dynhull_gateway.settings import Settings

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]


@pytest.fixture
def square(gateway: Gateway, name: str) -> str:
    assert gateway.post("/hulls", {"name": name}).status == 201
    assert gateway.post(f"/hulls/{name}/points", SQUARE).json["revision"] == 1
    return name


def test_what_is_not_http_is_a_problem_as_all_others(gateway: Gateway) -> None:
    host, _, port = gateway.place.rpartition(":")
    for sent in (b"HULLO /hulls HTTP/1.1\r\n\r\n", b"GET /hulls HTTP/1.1\r\nbad header\r\n\r\n", b"\x16\x03\x01\x02"):
        with socket.create_connection((host, int(port)), PATIENCE) as connection:
            connection.sendall(sent)
            response = http.client.HTTPResponse(connection)
            response.begin()
            problem = json.loads(response.read())
            assert (response.status, response.headers["Content-Type"]) == (400, "application/problem+json")
            assert (problem["status"], problem["reason"]) == (400, "MALFORMED_MESSAGE")
            assert connection.recv(1) == b"", "the connection is closed"


@pytest.mark.parametrize(("path", "kind"), [("points", "application/json"), ("rows", NDJSON)])
def test_two_numbers_for_one_request_are_refused(gateway: Gateway, square: str, path: str, kind: str) -> None:
    connection = gateway.connection()
    connection.putrequest("POST", f"/hulls/{square}/{path}")
    for name, value in (("Content-Type", kind), ("Content-Length", "5")):
        connection.putheader(name, value)
    for number in (1, 2):
        connection.putheader("Idempotency-Key", f"p:{number}")
    connection.endheaders(b"[1,2]")
    response = connection.getresponse()
    problem = json.loads(response.read())
    connection.close()
    assert (response.status, problem["field"], problem["reason"]) == (400, "Idempotency-Key", "INVALID_FIELD")
    assert problem["value"] == "p:1, p:2"
    assert gateway.get(f"/hulls/{square}").json["info"]["revision"] == 1


def test_questions_have_the_answers_of_the_sdk(gateway: Gateway, address: str, square: str) -> None:
    asked = [[1, 1], [4, 2], [9, 9]]
    with HullClient(address) as client:
        sides = client.locate(square, asked).sides.tolist()
        distances = client.distance(square, asked).distances.tolist()
        tangents = client.tangents(square, [[9, 9]]).tangents.tolist()
        crossings = client.intersect_lines(square, [[-1, 1]], [[9, 1]]).crossings.tolist()
        measures = client.get_measures(square)
    points = {"points": asked}
    at = f"/hulls/{square}"
    assert gateway.post(f"{at}/locate", points).json == {"revision": 1, "sides": sides, "keys_revision": None}
    assert gateway.post(f"{at}/distance", points).json["distances"] == distances
    assert gateway.post(f"{at}/count", points).json["counts"] == [0, 0, 0]
    assert gateway.post(f"{at}/support", {"directions": [[1, 1]]}).json["vertices"] == [[4, 4]]
    inside_and_outside = gateway.post(f"{at}/tangents", {"points": [[1, 1], [9, 9]]}).json["tangents"]
    assert inside_and_outside == [[[None, None], [None, None]], *tangents]
    lines = {"origins": [[-1, 1]], "targets": [[9, 1]]}
    assert gateway.post(f"{at}/intersect-lines", lines).json["crossings"] == crossings
    series = gateway.get(f"{at}/series?last=3600").json
    assert (series["areas"][-1], series["rates"][0], series["widths"][-1]) == (16, None, 4)
    assert series["times"][-1] > series["since"][:19]
    assert gateway.get(f"{at}/series?last=0").status == 400
    shown = gateway.get(f"{at}/measures").json
    assert (shown["diameter"], shown["min_circle"]["radius"]) == (measures.diameter, measures.min_circle[1])
    assert gateway.get(f"{at}/sample?size=2").json["points"] == gateway.get(f"{at}/sample?size=2").json["points"]
    assert gateway.get(f"{at}/layers?count=2").json == {"revision": 1, "layers": [SQUARE], "keys": None}
    assert gateway.get(f"{at}/influence").json["areas"] == [8, 8, 8, 8]
    assert gateway.post(f"{at}/locate?layer=2", points).json["sides"] == [-1, -1, -1]
    assert gateway.get(f"{at}/verification").json["equal"] is True
    assert gateway.get(f"{at}/separation?other={square}").json["intersect"] is True
    hull = gateway.get(at).json
    assert (hull["vertices"], hull["measures"]["area"], hull["info"]["points"]) == (SQUARE, 16, 4)
    feature = gateway.get(f"{at}?f=geojson")
    assert feature.headers["Content-Type"] == "application/geo+json"
    assert feature.json["geometry"]["coordinates"] == [[*SQUARE, SQUARE[0]]]
    assert gateway.get(f"/hulls?prefix={square}").json["hulls"] == [hull["info"]]
    assert gateway.call("DELETE", at).status == 204
    assert gateway.get(at).status == 404


def test_a_hull_without_points_has_null_where_there_is_no_number(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name})
    assert gateway.post(f"/hulls/{name}/distance", {"points": [[0, 0]]}).json["distances"] == [None]
    assert gateway.get(f"/hulls/{name}").json["measures"]["centroid"] == [None, None]
    assert gateway.get(f"/hulls/{name}?f=geojson").json["geometry"] is None


def test_keys_and_transfers(gateway: Gateway, name: str) -> None:
    north, south = f"{name}/north", f"{name}/south"
    for each in (north, south):
        assert gateway.post("/hulls", {"name": each, "keyed": "str"}).status == 201
    at, other = (f"/hulls/{each.replace('/', '%2F')}" for each in (north, south))
    put = {"keys": ["a", "b"], "points": [[0, 0], [1, 1]]}
    assert gateway.post(f"{at}/points", put).json["inserted"] == 2
    moved = {"batches": {north: {"remove": ["a"]}, south: {"keys": ["a"], "points": [[5, 5]]}}}
    results = gateway.post("/transfers", moved, Idempotency_Key=f"{name}:1").json["results"]
    assert (results[north]["deleted"], results[south]["inserted"]) == (1, 1)
    again = gateway.post("/transfers", moved, Idempotency_Key=f"{name}:1").json["results"]
    assert again[north]["duplicate"]
    found = gateway.post(f"{at}/positions", {"keys": ["a", "b"]}).json
    assert (found["present"], found["positions"]) == ([False, True], [[None, None], [1, 1]])
    assert gateway.get(f"{other}/entities").json == {
        "revision": 1,
        "keys": ["a"],
        "points": [[5, 5]],
        "times": None,
        "accuracies": None,
    }
    assert gateway.post(f"{at}/locate", {"keys": ["a"], "keys_of": south}).json["sides"] == [-1]
    gateway.post(f"{at}/points", {"keys": ["t"], "points": [[2, 2]], "times": ["2026-01-31T12:00:00Z"]})
    at_noon = gateway.get(f"{at}/entities").json
    assert (at_noon["keys"], at_noon["times"]) == (["b", "t"], [None, "2026-01-31T12:00:00.000000Z"])


def test_the_largest_keys_come_back_from_every_read(gateway: Gateway, name: str) -> None:
    largest = 2**64 - 1
    at = f"/hulls/{name}"
    assert gateway.post("/hulls", {"name": name, "keyed": "int"}).status == 201
    assert gateway.post(f"{at}/points", {"keys": [largest], "points": [[2, 1]]}).status == 200
    assert gateway.get(at).json["vertex_keys"] == [largest]
    assert gateway.get(f"{at}/entities").json["keys"] == [largest]
    for read in ("sample", "influence"):
        assert gateway.get(f"{at}/{read}?keys=true").json["keys"] == [largest]
    assert gateway.get(f"{at}/layers?keys=true").json["keys"] == [[largest]]
    assert gateway.post(f"{at}/support", {"directions": [[1, 0]], "keys": True}).json["keys"] == [largest]


def test_fences(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    fence = {"name": name, "area": {"exterior": SQUARE}, "subjects": name}
    created = gateway.post("/fences", fence)
    assert (created.status, created.json["area"]) == (201, [{"exterior": SQUARE, "holes": []}])
    gateway.post(f"/hulls/{name}/points", {"keys": ["a"], "points": [[1, 1]]})
    assert gateway.get(f"/fences/{name}/inside").json["subjects"] == [{"hull": name, "keys": ["a"], "revision": 1}]
    verified = gateway.get(f"/hulls/{name}/verification").json
    assert (verified["whole"], verified["fences"], verified["fence_differences"]) == (True, 1, [])
    circle = {"area": {"center": [9, 9], "radius": 1}, "subjects": name}
    assert gateway.call("PUT", f"/fences/{name}", circle).json["area"] == circle["area"]
    acknowledged = gateway.call("PUT", f"/fences/{name}/consumers/c", {"sequence": 1})
    assert acknowledged.json["acknowledged"] == 1
    assert [each["name"] for each in gateway.get(f"/fences/{name}").json["consumers"]] == ["c"]
    assert gateway.call("DELETE", f"/fences/{name}/consumers/c").status == 204
    assert gateway.get(f"/fences?prefix={name}").json["fences"][0]["name"] == name
    assert gateway.call("DELETE", f"/fences/{name}").status == 204


def test_lists_have_pages(gateway: Gateway, name: str) -> None:
    names = [f"{name}-{number}" for number in range(5)]
    for each in names:
        gateway.post("/hulls", {"name": each})
    found, after = [], ""
    while after is not None:
        page = gateway.get(f"/hulls?prefix={name}&limit=2&after={after}").json
        found += [each["name"] for each in page["hulls"]]
        after = page["next"]
    assert found == names


BAD = [
    ("/points", {"insert": [[0, 0], [1, "2"]]}, ("insert", 1, '"2"', "/insert/1/1")),
    ("/points", {"insert": [[0, 0], [1]]}, ("insert", 1, None, "/insert/1")),
    ("/points", [[0, 0], [True, 1]], ("body", 1, "true", "/1/0")),
    ("/points", {"inserts": []}, ("inserts", None, "[]", "/inserts")),
    ("/points", {"keys": ["a", 1.5], "points": [[0, 0], [1, 1]]}, ("keys", 1, "1.5", "/keys/1")),
    ("/points", {"keys": ["a", 1], "points": [[0, 0], [1, 1]]}, ("keys", 1, "1", "/keys/1")),
    ("/points", {"keys": ["a", "b"], "points": [[0, 0]]}, ("points", None, None, "/points")),
    ("/points", {"move": {"origins": [[0, 0]], "destinations": []}}, ("move", None, None, "/move/destinations")),
    ("/points", {"insert": [[0, 0]], "times": []}, ("times", None, None, "/times")),
    ("/points", {"insert": [[0, 0]], "remove": ["a"]}, ("insert", None, None, "/insert")),
    ("/points", {"keys": ["a"]}, ("keys", None, None, "/keys")),
    ("/locate", {"points": [[0, 0], [1, None]]}, ("points", 1, "null", "/points/1/1")),
    ("/intersect-lines", {"origins": [[0, 0]], "targets": []}, ("targets", None, "[]", "/targets")),
    ("/support", {"directions": [[0, 1], [0, 0]]}, ("directions", 1, "[0, 0]", "/directions/1")),
    ("/locate", [], ("body", None, "[]", "")),
]


@pytest.mark.parametrize(("path", "body", "cause"), BAD)
def test_errors_name_field_row_and_value(
    gateway: Gateway, square: str, path: str, body: object, cause: tuple[str, int | None, str | None, str]
) -> None:
    refused = gateway.post(f"/hulls/{square}{path}", body)
    assert (refused.status, refused.headers["Content-Type"]) == (400, "application/problem+json")
    said = refused.json
    field, row, value, pointer = cause
    assert (said["field"], said.get("row"), said["errors"][0]["pointer"]) == (field, row, pointer), said
    assert value is None or said["value"] == value
    assert gateway.get(f"/hulls/{square}").json["info"]["revision"] == 1


def test_the_server_s_errors_have_the_names_of_the_request(gateway: Gateway, name: str) -> None:
    """JSON pointers into the body, whatever the messages of the server are made of; names may have slashes."""
    keyed, globe = f"{name}/keyed", f"{name}/globe"
    gateway.post("/hulls", {"name": keyed, "keyed": "str"})
    gateway.post("/hulls", {"name": globe, "geographic": True})
    at, other = (f"/hulls/{each.replace('/', '%2F')}/points" for each in (keyed, globe))
    put, far = {"keys": ["a"], "points": [[0, 0]]}, {"insert": [[0, 0], [0, 91]]}
    ring = {"exterior": [[0, 0], [1, 1], [1, 0], [0, 1]]}
    around = {"name": name, "area": {"hull": keyed}}
    cases = [
        (gateway.post(at, [[1, 2]]), 409, "/0"),
        (gateway.post(at, {"insert": [[1, 2]]}), 409, "/insert/0"),
        (gateway.post(at, {"keys": ["a", "a"], "points": [[0, 0], [1, 1]]}), 400, "/keys/1"),
        (gateway.post(at, {"remove": ["b"], "missing": "raise"}), 409, "/remove/0"),
        (gateway.post(other, far), 400, "/insert/1"),
        (gateway.post(other, far, Idempotency_Key="far:1"), 400, "/insert/1"),
        (gateway.post(other, far["insert"]), 400, "/1"),
        (
            gateway.post("/transfers", {"batches": {keyed: put, globe: far}}),
            400,
            f"/batches/{globe.replace('/', '~1')}/insert/1",
        ),
        (gateway.post("/fences", {"name": name, "area": [ring], "subjects": keyed}), 400, "/area/0/exterior"),
        (gateway.post("/fences", {"name": name, "area": {"center": [0, 0]}, "subjects": keyed}), 400, "/area/radius"),
        (gateway.post("/hulls", {"name": "x", "center": [0, 0]}), 400, "/center"),
        (gateway.post("/hulls", {"name": "x", "keyed": "str", "max_points": 9, "shards": 2}), 409, "/max_points"),
        (gateway.post("/fences", {**around, "other_hull": name, "crosses": True}), 400, "/crosses"),
        (gateway.post("/fences", {**around, "subjects": globe, "without_self": True}), 400, "/without_self"),
        (gateway.post("/fences", {"name": name, "area": [], "subjects": keyed}), 400, "/area"),
        (gateway.post("/fences", {"name": name, "area": ring, "subjects": keyed}), 400, "/area/exterior"),
    ]
    for answer, status, pointer in cases:
        said = answer.json
        assert (answer.status, said["errors"][0]["pointer"]) == (status, pointer), said
        assert not any(word in said["detail"] for word in ("batch.", "config.", "puts.", "inserts.", "True", "None")), (
            said
        )
    assert '"keys": [KEY' in cases[0][0].json["detail"]


def test_the_type_of_a_body_is_named(gateway: Gateway, square: str) -> None:
    """curl -d sends a form unless it is told otherwise."""
    form = "application/x-www-form-urlencoded"
    for path in ("/hulls", f"/hulls/{square}/points", f"/hulls/{square}/locate", "/fences"):
        refused = gateway.post(path, b"{}", form)
        assert (refused.status, refused.json["value"]) == (415, form)
        assert "curl sends with -H 'Content-Type: application/json'" in refused.json["detail"]
    assert gateway.call("POST", "/hulls").json["detail"] == "body: is required"


ENCODINGS = [
    (b'\xef\xbb\xbf{"points": [[0, 0]]}', None),
    ('{"points": [[0, 0]]}'.encode("utf-16"), "not JSON"),
    (b'{"points": [[0, 0]], "\xe9": 0}', "not JSON"),
    (b'{"points": [[NaN, 0]]}', "/points/0/0: must be a finite number"),
    (b'{"points": [[1%s, 0]]}' % (b"0" * 400), "/points/0/0: must be a valid number"),
    (b'{"points": [[1%s, 0]]}' % (b"0" * 9000), "not JSON"),
    (b'{"points": %s' % (b"[" * 100_000), "not JSON"),
]


@pytest.mark.parametrize(("body", "problem"), ENCODINGS)
def test_encodings_and_numbers(gateway: Gateway, square: str, body: bytes, problem: str | None) -> None:
    answer = gateway.post(f"/hulls/{square}/count", body, "application/json")
    assert answer.status == (200 if problem is None else 400)
    assert problem is None or problem in answer.json["detail"]


def test_refusals_of_the_server_have_their_status_and_reason(hasty: Gateway, gateway: Gateway, square: str) -> None:
    at = f"/hulls/{square}"
    cases = [
        (gateway.post("/hulls", {"name": square}), 409, "HULL_EXISTS"),
        (gateway.get("/hulls/there-is-none"), 404, "HULL_NOT_FOUND"),
        (gateway.post(f"{at}/points", {"delete": [[0, 0], [7, 7]]}), 409, "POINT_MISSING"),
        (gateway.get(f"{at}/entities"), 409, "HULL_UNSUITABLE"),
        (hasty.get(f"{at}?min_revision=99"), 409, "REVISION_NOT_REACHED"),
        (hasty.get(f"{at}/separation?other={square}&other_min_revision=99"), 409, "REVISION_NOT_REACHED"),
        (gateway.post(f"{at}/points", SQUARE, Idempotency_Key=f"{square}:2"), 409, "SEQUENCE_GAP"),
        (gateway.post(f"{at}/points", SQUARE, Idempotency_Key="no number"), 400, "INVALID_FIELD"),
        (gateway.get(f"{at}?min_revision=-1"), 400, "INVALID_FIELD"),
        (gateway.post(f"{at}/points", b"[[0, 0", "application/json"), 400, "INVALID_FIELD"),
        (gateway.post(f"{at}/points", b"x", "text/plain"), 415, "MEDIA_TYPE"),
        (gateway.post(f"{at}/locate", b" " * 2**20 + b"{}", "application/json"), 413, "BODY_TOO_LARGE"),
        (gateway.get("/hulls/bad%20name"), 400, "INVALID_FIELD"),
        (gateway.get("/nowhere"), 404, "PATH_NOT_FOUND"),
        (gateway.get(f"{at}/row"), 404, "PATH_NOT_FOUND"),
        (gateway.call("PUT", f"{at}/rows"), 405, "METHOD_NOT_ALLOWED"),
    ]
    for answer, status, reason in cases:
        assert (answer.status, answer.json["status"], answer.json["reason"]) == (status, status, reason), answer.json
    assert cases[2][0].json["row"] == 1
    refused = gateway.call("PATCH", at)
    assert (refused.status, refused.headers["Allow"]) == (405, "DELETE, GET, HEAD")
    assert f"{at} takes DELETE, GET, HEAD, not PATCH" in refused.json["detail"]
    assert gateway.call("PUT", "/openapi.json").headers["Allow"] == "GET, HEAD"
    assert "near it are /hulls/{name}/points," in gateway.get("/hulls//points").json["detail"]
    assert gateway.post(f"{at}/points", [[0, "x"]]).json["field"] == "body"
    assert gateway.get("/hulls", Authorization=f"Bearer {'x' * 20_000}").status == 401
    assert f"{at}/rows" in next(
        answer.json["detail"] for answer, _, _ in cases if answer.json.get("value") == f"{at}/row"
    )
    for url in (f"{at}/measures?layr=2", f"{at}/events?layr=2"):
        misspelled = gateway.get(url)
        assert (misspelled.status, misspelled.json["field"]) == (400, "layr")
        assert "did you mean layer?" in misspelled.json["detail"]
    assert "here are min_revision" in gateway.get(f"{at}/verification?another=3").json["detail"]
    assert "must be a name: 1 to 200 letters" in gateway.get("/hulls/bad%20name").json["detail"]
    assert (
        "must be PRODUCER:SEQUENCE" in gateway.post(f"{at}/points", SQUARE, Idempotency_Key="no number").json["detail"]
    )


def test_parameters_are_those_of_the_description_which_no_request_waits_for() -> None:
    app = application(None, Settings())  # type: ignore[arg-type]  # the refused request goes no further
    status, _ = asyncio.run(called(app, "/hulls/a/measures?layr=2"))
    assert (status, app.openapi_schema) == (400, None)
    described = app.openapi()["paths"]
    compared = 0
    for route in app.state.routes:
        for method in route.methods if isinstance(route, APIRoute) else ():
            parameters = described[route.path_format][method.lower()].get("parameters", ())
            named = [each["name"] for each in parameters if each["in"] == "query"]
            assert list(taken(route.dependant)) == named, (method, route.path_format)
            compared += bool(named)
    assert compared > 30


def test_head_is_get_without_the_body(gateway: Gateway, square: str) -> None:
    connection = gateway.connection()  # one for all: what follows a body would be out of step
    for path in ("/", f"/hulls/{square}", f"/hulls/{square}?f=geojson", f"/hulls/{square}/events", "/nowhere"):
        connection.request("HEAD", path)
        response = connection.getresponse()
        assert (response.status, response.read()) == (404 if path == "/nowhere" else 200, b""), path
        whole = gateway.get(path) if not path.endswith("/events") else None
        assert whole is None or response.headers["Content-Length"] == str(len(whole.body))
    connection.request("HEAD", f"/hulls/{square}/points")
    assert connection.getresponse().status == 405
    connection.close()


def test_a_numbered_batch_is_applied_once(gateway: Gateway, square: str) -> None:
    posted = [gateway.post(f"/hulls/{square}/points", [[9, 9]], Idempotency_Key='"a/b:1"').json for _ in range(2)]
    assert [each["duplicate"] for each in posted] == [False, True]
    assert gateway.get(f"/hulls/{square}").json["info"]["points"] == 5
    assert gateway.get(f"/hulls/{square}/producers/a%2Fb").json == {"last_sequence": 1}


def test_many_small_requests_share_batches_and_each_has_its_own_error(gateway: Gateway, name: str) -> None:
    """A geographic hull refuses places that are too far away: one bad request among many is refused alone."""
    gateway.post("/hulls", {"name": name, "geographic": True, "center": [0, 0]})
    answers: dict[int, int] = {}

    def send(number: int) -> None:
        connection = gateway.connection()
        for i in range(20):
            bad = (number, i) == (3, 10)
            body = json.dumps([[170 if bad else number, i]])
            connection.request("POST", f"/hulls/{name}/points", body, {"Content-Type": "application/json"})
            response = connection.getresponse()
            response.read()
            answers[20 * number + i] = response.status
        connection.close()

    senders = [threading.Thread(target=send, args=[number]) for number in range(8)]
    for each in senders:
        each.start()
    for each in senders:
        each.join()
    assert {number for number, status in answers.items() if status != 200} == {70}
    assert answers[70] == 400
    info = gateway.get(f"/hulls/{name}").json["info"]
    assert info["points"] == 159
    assert info["revision"] < 159


def test_tokens_are_passed_on(tmp_path) -> None:
    import hashlib

    digest = hashlib.sha256(b"secret").hexdigest()
    tokens = tmp_path / "tokens.toml"
    tokens.write_text(f'[[token]]\nsha256 = "{digest}"\nread = ["a"]\nwrite = ["a"]\n')
    with (
        server_process("--tokens", str(tokens), "--log-level", "error") as server,
        gateway_process(server.address) as gateway,
    ):
        anonymous = gateway.get("/hulls/a")
        assert (anonymous.status, anonymous.headers["WWW-Authenticate"]) == (401, "Bearer")
        assert gateway.get("/hulls/a", Authorization="Basic x").status == 401
        wrong = gateway.get("/hulls/a", Authorization="Bearer wrong")
        assert (wrong.status, "Authorization: Bearer TOKEN" in wrong.json["detail"]) == (401, True)
        assert gateway.post("/hulls", {"name": "a"}, Authorization="Bearer secret").status == 201
        assert gateway.post("/hulls/a/points", [[0, 0]], Authorization="Bearer secret").status == 200
        assert gateway.post("/hulls/b/points", [[0, 0]], Authorization="Bearer secret").status == 403
        assert gateway.post("/hulls/a/points", [[0, 0]], Authorization="Bearer wrong").status == 401
        assert gateway.get("/readyz").status == 200


def test_other_origins_only_if_allowed(gateway: Gateway, address: str) -> None:
    asked = {"Origin": "https://pages.example", "Access_Control_Request_Method": "POST"}
    assert "Access-Control-Allow-Origin" not in gateway.call("OPTIONS", "/hulls", **asked).headers
    with gateway_process(address, "--origin", "https://pages.example") as open_gateway:
        allowed = open_gateway.call("OPTIONS", "/hulls", **asked)
        assert allowed.headers["Access-Control-Allow-Origin"] == "https://pages.example"
        asked["Origin"] = "https://others.example"
        assert "Access-Control-Allow-Origin" not in open_gateway.call("OPTIONS", "/hulls", **asked).headers


def test_json_ends_with_a_newline(gateway: Gateway, square: str) -> None:
    for path in (
        "/",
        "/livez",
        "/hulls",
        f"/hulls/{square}",
        f"/hulls/{square}?f=geojson",
        "/nowhere",
        "/openapi.json",
    ):
        assert gateway.get(path).body.endswith(b"}\n"), path
    for body in ([[1, 1]], [[1, "1"]], {"insert": [[1, 1]]}):
        assert gateway.post(f"/hulls/{square}/points", body).body.endswith(b"}\n")
    deleted = gateway.call("DELETE", f"/hulls/{square}")
    assert (deleted.status, deleted.body, deleted.headers.get("Content-Length")) == (204, b"", None)


def test_a_port_in_use_is_said_in_words(gateway: Gateway) -> None:
    refused = dynhull("gateway", "--port", gateway.place.rpartition(":")[2])
    assert refused.exit_code == 2
    assert f"cannot listen on {gateway.place}: another program uses this port: stop it" in " ".join(
        refused.stderr.split()
    )


@pytest.mark.parametrize("text", ["nonsense", "127.0.0.1:8000", "https://pages.example/", "https://pages.example:x"])
def test_what_no_browser_sends_is_no_origin(text: str) -> None:
    refused = dynhull("gateway", "--port", "0", "--origin", text)
    assert refused.exit_code == 2
    assert f"--origin {text!r} must be * or an origin as browsers send it" in " ".join(refused.stderr.split())


def test_numbers_are_those_of_the_hull(gateway: Gateway, address: str, name: str) -> None:
    """Each double arrives and comes back as it is."""
    gateway.post("/hulls", {"name": name})
    xy = np.random.default_rng(7).normal(size=(50, 2)) * 10.0 ** np.arange(-150, 150, 6)[:, None]
    gateway.post(f"/hulls/{name}/points", xy.tolist())
    with HullClient(address) as client:
        assert client.count(name, xy).counts.all()
        assert gateway.get(f"/hulls/{name}").json["vertices"] == client.get_hull(name).vertices.tolist()


def test_a_hull_over_shards(gateway: Gateway, name: str) -> None:
    assert gateway.post("/hulls", {"name": name, "shards": 2}).json["shards"] == 2
    assert gateway.post(f"/hulls/{name}/points", SQUARE).json["revision"] == 1
    assert gateway.post(f"/hulls/{name}/count", {"points": SQUARE[:2]}).json["counts"] == [1, 1]
    assert gateway.post(f"/hulls/{name}/reshard", {"shards": 3}).json["shards"] == 3
    assert gateway.post(f"/hulls/{name}/reshard", {"shards": 0}).status == 400
    refused = gateway.post("/hulls", {"name": f"{name}-2", "shards": 2, "geographic": True})
    assert "is geographic, so it cannot be divided" in refused.json["detail"]
