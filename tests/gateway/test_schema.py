"""Requests made from the OpenAPI document: none is answered with 5xx, and answers are as described.

Some checks of Schemathesis cannot hold: whether a request is accepted depends on the hull (`positive_data_acceptance`)
and on whether the server has tokens (`ignored_auth`, `missing_required_header`). Streams of events do not end.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from cases import slow
from gateway_process import Events, Gateway, gateway_process
from peers import missing
from server_process import server_process

EXAMPLES = os.environ.get("FUZZ_EXAMPLES", "1")
NOT_CHECKED = "positive_data_acceptance,ignored_auth,missing_required_header"
HOOKS = Path(__file__).parents[1] / "support"


@pytest.fixture
def gateway(tmp_path: Path) -> Iterator[Gateway]:
    """A gateway that soon gives up waiting: random least revisions are never reached. Its server can keep a past."""
    with (
        server_process("--data", str(tmp_path / "data")) as server,
        gateway_process(server.address, "--timeout", "3s", "--max-body", "1") as running,
    ):
        yield running


def examples(operation: dict[str, Any]) -> list[Any]:
    """The examples of the body of an operation."""
    (content,) = operation["requestBody"]["content"].values()
    return [each["value"] for each in content["examples"].values()]


def calls(described: dict[str, Any], path: str, operation: dict[str, Any]) -> Iterator[tuple[str, Any, str | None]]:
    """The paths, bodies and media types that the examples of an operation make; those of one name go together."""
    parameters = [each for each in operation.get("parameters", ()) if each["required"]]
    fixed = {each["name"]: each["schema"]["examples"][0] for each in parameters if "examples" not in each}
    path += "&".join(f"?{each['name']}={fixed[each['name']]}" for each in parameters if each["in"] == "query")
    for kind, content in operation.get("requestBody", {"content": {None: {}}})["content"].items():
        if "example" in content:
            yield path.format(**fixed), content["example"].encode(), kind
        elif "examples" in content:
            for name, each in content["examples"].items():
                chosen = {of["name"]: of["examples"][name]["value"] for of in parameters if "examples" in of}
                yield path.format(**fixed, **chosen), each["value"], kind
        elif kind is None:
            yield path.format(**fixed), None, None
        else:
            schema = content["schema"]["$ref"].rpartition("/")[2]
            yield path.format(**fixed), described["components"]["schemas"][schema]["examples"][0], kind


def remove(gateway: Gateway, hulls: list[str]) -> None:
    """Delete all fences and alarms, then these hulls."""
    for kind in ("fences", "alarms"):
        for each in gateway.get(f"/{kind}?limit=1000").json[kind]:
            gateway.call("DELETE", f"/{kind}/{quote(each['name'], safe='')}")
    for name in hulls:
        gateway.call("DELETE", f"/hulls/{name}")


@slow
def test_every_example_of_the_description_works(gateway: Gateway) -> None:
    """In the order of the description, and then deletions in the reverse order."""
    described = gateway.get("/openapi.json").json
    operations = [(path, method, each) for path, of in described["paths"].items() for method, each in of.items()]
    made = [each["name"] for each in examples(described["paths"]["/hulls"]["post"])]
    fences = [each["name"] for each in examples(described["paths"]["/fences"]["post"])]
    assert made[0] == "fleet"
    deletions = [each for each in operations if each[1] == "delete"]
    called = 0
    remove(gateway, made)  # of the other test, on the same server
    try:
        for path, method, operation in [*(each for each in operations if each[1] != "delete"), *reversed(deletions)]:
            if path == "/hulls/{name}" and method == "delete":
                for name in fences[1:]:  # all of which need the hull
                    gateway.call("DELETE", f"/fences/{name}")
            if path.startswith("/streams/"):  # of a stream that is read meanwhile: tests/gateway/test_joined_events.py
                continue
            for at, body, kind in calls(described, path, operation):
                if at == "/streams":
                    joined = Events(gateway, at, body)
                    assert (joined.next()[0], joined.next()[0] != "problem") == ("stream", True)
                    joined.close()
                    continue
                if at.endswith(("/events", "/feed")):
                    start = (
                        "?prefix=fleet&begin=true"
                        if at == "/feed"
                        else "?after=0"
                        if "fences" in at or "alarms" in at or "/feed" in at
                        else ""
                    )
                    events = Events(gateway, at + start)
                    assert events.response.status == 200, (at, events.response.read())
                    assert events.next()
                    events.close()
                    continue
                answer = gateway.call(method.upper(), at, body, kind)
                assert answer.status in (200, 201, 204), (method, at, body, answer.body)
                called += 1
    finally:
        remove(gateway, made)
    assert called > len(operations)


@slow
def test_answers_are_as_described(gateway: Gateway, tmp_path: Path) -> None:
    described = gateway.get("/openapi.json").json
    for each in (*examples(described["paths"]["/hulls"]["post"]), {"name": "0"}):
        gateway.post("/hulls", {**each, "exist_ok": True})
    program = Path(sys.executable).with_name("schemathesis")
    if not program.exists():
        missing("schemathesis", "install the extra test")
    if "FUZZ_EXAMPLES" in os.environ:
        phases, chosen = "examples,coverage,fuzzing", ["--generation-database", "none"]
    else:
        phases, chosen = "examples,fuzzing", ["--generation-deterministic"]
    run = subprocess.run(
        [
            *(program, "run", f"{gateway.url}/openapi.json", "--no-color", "--phases", phases),
            *(
                "--max-examples",
                EXAMPLES,
                "--exclude-checks",
                NOT_CHECKED,
                "--exclude-path-regex",
                "/(events|replay|feed|streams)$",
            ),
            *("--request-timeout", "60", "--suppress-health-check", "all", *chosen),
        ],
        cwd=tmp_path,
        env={**os.environ, "SCHEMATHESIS_HOOKS": "schemathesis_hooks", "PYTHONPATH": str(HOOKS)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-20_000:] + run.stderr
