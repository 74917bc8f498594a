"""A client of other authors calls the server: @grpc/grpc-js, from the .proto files alone."""

import json
import subprocess

from peers import javascript, program
from server_process import PATIENCE


def test_a_client_in_another_language(address: str, name: str) -> None:
    command = [program("node"), "client.js", address, name]
    done = subprocess.run(command, cwd=javascript(), capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr
    saw = json.loads(done.stdout)
    assert (saw["created"]["name"], saw["created"]["revision"]) == (name, 0)
    assert saw["snapshot"]["event"] == "snapshot"
    assert [each["sequence"] for each in saw["acknowledged"]] == [1, 2, 3]
    assert [each["result"]["revision"] for each in saw["acknowledged"]] == [1, 2, 3]
    assert [each["result"]["point_count"] for each in saw["acknowledged"]] == [2, 4, 5]
    assert saw["ended"] is True
    assert saw["event"]["revision"] >= 2
    assert saw["hull"]["vertices"]["coordinates"] == [0, 0, 4, 0, 4, 4, 0, 4]
    assert saw["hull"]["measures"]["area"] == 16
    assert saw["sides"] == [1, 255]
    assert saw["verified"] is True
    assert saw["refused"]["code"] == 9
    assert "batch.deletes[0] is (8.0, 8.0)" in saw["refused"]["details"]
