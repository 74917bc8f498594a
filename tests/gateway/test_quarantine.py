"""The quarantine of keyed hulls over HTTP."""

from concurrent.futures import ThreadPoolExecutor

from gateway_process import Gateway

SQUARE = {"keys": ["a", "b", "c", "d"], "points": [[0, 0], [4, 0], [4, 4], [0, 4]]}


def test_rules_held_positions_releases_and_drops(gateway: Gateway, name: str) -> None:
    rules = {"max_speed": None, "max_growth": 1.5, "confirmations": 0}
    created = gateway.post("/hulls", {"name": name, "keyed": "str", "quarantine": rules}).json
    assert (created["quarantine"], created["held"]) == (rules, 0)
    at = f"/hulls/{name}"
    gateway.post(f"{at}/points", SQUARE)
    put = gateway.post(f"{at}/points", {"keys": ["f", "e", "b"], "points": [[1, 1], [4, 40], [99, 0]]}).json
    assert (put["held"], put["held_rows"], put["inserted"]) == (2, [1, 2], 1)
    first = gateway.get(f"{at}/held?limit=1").json
    assert (len(first["held"]), first["next"]) == (1, "b")
    rest = gateway.get(f"{at}/held?after=b").json
    assert rest["next"] is None
    assert rest["held"] == [
        {
            "key": "e",
            "position": [4, 40],
            "time": None,
            "breaks": ["max_growth"],
            "speed": None,
            "growth": 5.5,
            "revision": 2,
            "confirmations": 0,
            "accuracy": 0.0,
        }
    ]
    changed = gateway.post(f"{at}/points", {"release": ["e"], "drop": ["b", "x"]}, Idempotency_Key=f"{name}:1").json
    assert (changed["released"], changed["dropped"], changed["missing"]) == (1, 1, 1)
    again = gateway.post(f"{at}/points", {"release": ["e"], "drop": ["b", "x"]}, Idempotency_Key=f"{name}:1").json
    assert again["duplicate"]
    assert gateway.call("PUT", f"{at}/quarantine", {"max_speed": 10}).json["quarantine"]["max_speed"] == 10
    assert gateway.get(at).json["info"]["held"] == 0

    for rules in ({"max_speed": 0}, {"max_growth": 0.5}, {"confirmations": 1001}, {"speed": 1}):
        assert gateway.call("PUT", f"{at}/quarantine", rules).status == 400
    refused = gateway.post(f"{at}/points", {"release": ["a"], "remove": ["b"]})
    assert (refused.status, "a batch has either" in refused.json["detail"]) == (400, True)


def test_requests_that_are_gathered_know_their_own_held_rows(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "int", "quarantine": {"max_growth": 1.5}})
    gateway.post(f"/hulls/{name}/points", SQUARE | {"keys": [1, 2, 3, 4]})

    def put(key: int) -> list[int]:
        batch = {"keys": [key, key + 1], "points": [[1, 1], [9, 99]] if key % 4 else [[9, 99], [1, 1]]}
        return gateway.post(f"/hulls/{name}/points", batch).json["held_rows"]

    with ThreadPoolExecutor(16) as pool:
        found = list(pool.map(put, range(10, 138, 2)))
    assert found == [[1], [0]] * 32
    assert [each["key"] for each in gateway.get(f"/hulls/{name}/held?after=99&limit=2").json["held"]] == [100, 104 - 1]
    assert gateway.get(f"/hulls/{name}/held?after=x").json["field"] == "after"
