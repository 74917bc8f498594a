"""Requests made from the OpenAPI document: none is answered with 5xx, and answers are as described.

Some checks of Schemathesis cannot hold: whether a request is accepted depends on the hull (`positive_data_acceptance`)
and on whether the server has tokens (`ignored_auth`, `missing_required_header`). Streams of events do not end.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from gateway_process import Gateway, gateway_process
from peers import missing

EXAMPLES = os.environ.get("FUZZ_EXAMPLES", "1")
NOT_CHECKED = "positive_data_acceptance,ignored_auth,missing_required_header"
HOOKS = Path(__file__).parents[1] / "support"


@pytest.fixture
def gateway(address: str) -> Iterator[Gateway]:
    """A gateway that soon gives up waiting: random least revisions are never reached."""
    with gateway_process(address, "--timeout", "3s", "--max-body", "1") as running:
        yield running


@pytest.mark.long
def test_answers_are_as_described(gateway: Gateway, tmp_path: Path) -> None:
    for name, more in (
        ("0", {}),
        ("fleet", {"keyed": "str"}),
        ("north", {"keyed": "str"}),
        ("south", {"keyed": "str"}),
    ):
        gateway.post("/hulls", {"name": name, "exist_ok": True, **more})
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
            *("--max-examples", EXAMPLES, "--exclude-checks", NOT_CHECKED, "--exclude-path-regex", "/events$"),
            *("--request-timeout", "60", "--suppress-health-check", "all", *chosen),
        ],
        cwd=tmp_path,
        env={**os.environ, "SCHEMATHESIS_HOOKS": "schemathesis_hooks", "PYTHONPATH": str(HOOKS)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-20_000:] + run.stderr
