"""Alarms over HTTP, and their events over restarts of the server."""

from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from gateway_process import Events, Gateway, gateway_process
from mortal_server import MortalServer


def put(gateway: Gateway, hull: str, size: float) -> None:
    corners = [[0, 0], [size, 0], [size, size], [0, size]]
    answer = gateway.post(f"/hulls/{quote(hull, '')}/points", {"keys": ["a", "b", "c", "d"], "points": corners})
    assert answer.status == 200, answer.json


def next_of_alarm(events: Events) -> dict[str, Any]:
    """The next event, without those that say that the server is away or back."""
    while (event := events.next())[0] in ("unavailable", "available"):
        continue
    return event[1]


def created(gateway: Gateway, name: str, **rule: Any) -> dict[str, Any]:
    answer = gateway.post("/alarms", {"name": name, **rule})
    assert answer.status == 201, answer.json
    return answer.json


def test_an_alarm_is_created_raised_acknowledged_muted_and_deleted(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    shown = created(gateway, name, hull=name, when="area > 9", clear="area < 4", **{"for": 0, "max_event_age": 60})
    assert (shown["when"], shown["clear"], shown["hulls"], shown["for"]) == ("area > 9", "area < 4", 1, None)
    path = f"/alarms/{quote(name, '')}"
    refused = gateway.post(f"{path}/acknowledge", {"hull": name})
    assert (refused.status, refused.json["reason"]) == (409, "ALARM_NOT_RAISED")
    put(gateway, name, 4)
    assert gateway.get(path).json["raised"] == 1
    acknowledged = gateway.post(f"{path}/acknowledge", {"hull": name}).json
    assert (acknowledged["raised"], acknowledged["value"]) == (True, 16)
    assert acknowledged["acknowledged"] is not None
    muted = gateway.post(f"{path}/mute", {"hull": name, "until": "2100-01-01T00:00:00Z"}).json
    assert muted["muted_until"].startswith("2100-01-01T00:00:00")
    (status,) = gateway.get(path).json["statuses"]
    assert status == muted
    assert [each["name"] for each in gateway.get(f"/alarms?prefix={quote(name, '')}").json["alarms"]] == [name]
    assert gateway.post("/alarms", {"name": name, "hull": name, "when": "area > 9"}).json["reason"] == "ALARM_EXISTS"
    assert gateway.call("DELETE", path).status == 204
    assert gateway.get(path).json["reason"] == "ALARM_NOT_FOUND"


@pytest.mark.parametrize(
    ("rule", "field"),
    [
        ({"when": "area > 9", "clear": "area > 12"}, "clear"),
        ({"when": "aria > 9"}, "when"),
        ({"when": "area > 9", "for": "soon"}, "for"),
        ({"when": "area > 9", "until": 3}, "until"),
    ],
)
def test_what_is_wrong_is_named(gateway: Gateway, name: str, rule: dict[str, Any], field: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    refused = gateway.post("/alarms", {"name": name, "hull": name, **rule})
    assert refused.status in (400, 422), refused.json
    assert field in (refused.json.get("field"), refused.json.get("pointer", "").removeprefix("#/")), refused.json
    assert gateway.get(f"/alarms/{quote(name, '')}").status == 404


def test_events_go_on_over_kills_of_the_server(tmp_path: Path) -> None:
    server = MortalServer(tmp_path)
    with gateway_process(server.address) as gateway:
        gateway.post("/hulls", {"name": "fleet", "keyed": "str"})
        uid = created(gateway, "spread", hull="fleet", when="area > 9", clear="area < 9")["uid"]
        events = Events(gateway, "/alarms/spread/events")
        assert events.next() == (f"{uid}:0", None)
        put(gateway, "fleet", 4)
        kind, raised = events.next()
        assert (kind, raised["sequence"], raised["value"], raised["bound"]) == ("raised", 1, 16, 9)
        assert (raised["cause"], raised["hull"], raised["alarm"]) == (["batch"], "fleet", "spread")
        server.kill()
        server.start()
        put(gateway, "fleet", 1)
        assert next_of_alarm(events)["type"] == "cleared"
        resumed = Events(gateway, "/alarms/spread/events", Last_Event_ID=f"{uid}:1")
        assert resumed.next()[1]["sequence"] == 2
        consumer = Events(gateway, "/alarms/spread/events?consumer=pager")
        assert consumer.next()[1]["sequence"] == 1
        gateway.call("PUT", "/alarms/spread/consumers/pager", {"sequence": 1, "uid": uid})
        again = Events(gateway, "/alarms/spread/events?consumer=pager")
        assert again.next()[1]["sequence"] == 2
        assert gateway.get("/alarms/spread/events?after=3").json["reason"] == "SEQUENCE_AHEAD"
        assert gateway.get("/alarms/none/events").json["reason"] == "ALARM_NOT_FOUND"
        assert gateway.call("DELETE", "/alarms/spread/consumers/pager").status == 204
        gateway.call("DELETE", "/alarms/spread")
        assert events.next()[0] == "closed"
        created(gateway, "spread", hull="fleet", when="area > 9")
        replaced = Events(gateway, "/alarms/spread/events", Last_Event_ID=f"{uid}:1")
        assert replaced.next()[0] == "replaced"
        for each in (events, resumed, consumer, again, replaced):
            each.close()
    server.kill()
