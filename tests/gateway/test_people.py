"""What people find who try the gateway by hand: a page, paths that name their mistake, GeoJSON on request."""

import pytest
from gateway_process import Gateway


def test_the_description_is_a_page_that_loads_nothing(gateway: Gateway) -> None:
    page = gateway.get("/docs")
    text = page.body.decode()
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert page.headers["content-security-policy"].startswith("default-src 'none';")
    described = gateway.get("/openapi.json").json
    for path, operations in described["paths"].items():
        assert f"<code>{path}</code>" in text
        assert all(f'id="{operation["operationId"]}"' in text for operation in operations.values())
    assert all(f'id="schema-{name}"' in text for name in described["components"]["schemas"])
    assert "<script" not in text
    assert "://" not in text.replace("http://www.opengis.net", "")


def test_generators_find_servers_and_security(gateway: Gateway) -> None:
    described = gateway.get("/openapi.json").json
    assert described["servers"] == [{"url": "/"}]
    assert all("security" in operation for path in described["paths"].values() for operation in path.values())


@pytest.mark.parametrize(
    ("path", "meant"),
    [
        ("/hulls/fleet/ab", "/hulls/fleet%2Fab"),
        ("/hulls/fleet/ab/points", "/hulls/fleet%2Fab/points"),
        ("/hulls/a/b/c/events?f=geojson", "/hulls/a%2Fb%2Fc/events"),
        ("/fences/a/b/consumers/c", "/fences/a%2Fb/consumers/c"),
    ],
)
def test_a_slash_in_a_name_is_the_cause(gateway: Gateway, path: str, meant: str) -> None:
    answer = gateway.get(path)
    assert (answer.status, answer.json["reason"]) == (404, "PATH_NOT_FOUND")
    assert f" a slash in a name is written %2F, as in {meant};" in answer.json["detail"]


@pytest.mark.parametrize(
    ("query", "accept", "kind"),
    [
        ("", "application/geo+json", "application/geo+json"),
        ("", "application/json;q=0.5, application/geo+json;q=0.9", "application/geo+json"),
        ("", "application/geo+json, application/json", "application/json"),
        ("", "application/geo+json;q=0", "application/json"),
        ("", "application/geo+json;q=much", "application/json"),
        ("", "*/*", "application/json"),
        ("?f=json", "application/geo+json", "application/json"),
        ("?f=geojson", "application/json", "application/geo+json"),
    ],
)
def test_those_who_accept_geojson_get_it(gateway: Gateway, name: str, query: str, accept: str, kind: str) -> None:
    gateway.post("/hulls", {"name": name})
    answer = gateway.get(f"/hulls/{name}{query}", Accept=accept)
    assert (answer.headers["content-type"], answer.headers["vary"]) == (kind, "Accept")
