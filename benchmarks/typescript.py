"""The TypeScript package: `python benchmarks/typescript.py [--vertices 10000] [--points 200000] [--seconds 3]`.

Copies of a hull in Node and in Chromium: nanoseconds for a `locate`, of points anywhere and of points on edges, beside
one `orient2d` of robust-predicates (a locate takes two, and two searches); changes of one vertex applied a second, and
with a `side` after each. Then the rows a second that a writer has acknowledged, in one process each, of a hull with
integers as keys in memory: the Python SDK, Node over gRPC, and Node over a gateway, which take turns. Medians.

Needs `make peers`. Clients, gateway and server share the machine.
"""

import argparse
import json
import subprocess
import sys
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from dynhull_client import HullClient

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))

from chromium import chromium  # noqa: E402
from gateway_process import gateway_process  # noqa: E402
from server_process import server_process  # noqa: E402

MODULES = "/clients/typescript/node_modules"
MAP = {
    "lossless-json": f"{MODULES}/lossless-json/lib/esm/index.js",
    "robust-predicates": f"{MODULES}/robust-predicates/index.js",
}
PAGE = f'<!doctype html><script type="importmap">{json.dumps({"imports": MAP})}</script>'
RUN = """async sizes => {
    const [{measured}, {HullCopy}, {orient2d}] = await Promise.all(
        ["/benchmarks/copies.mjs", "/clients/typescript/src/index.js", "robust-predicates"].map(each => import(each)))
    return measured(HullCopy, orient2d, sizes)
}"""
NODE = """
import { measured } from "./benchmarks/copies.mjs"
import { HullCopy } from "./clients/typescript/src/index.js"
import { orient2d } from "./clients/typescript/node_modules/robust-predicates/index.js"
console.log(JSON.stringify(measured(HullCopy, orient2d, SIZES)))
"""
ROWS = 1000  # of a call of a writer


class Pages(SimpleHTTPRequestHandler):
    """The files of the project, and a page that finds the package in them."""

    def do_GET(self) -> None:
        if self.path != "/":
            return super().do_GET()
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(PAGE.encode())
        return None

    def log_message(self, *_: object) -> None:
        return


Pages.extensions_map |= {".mjs": "text/javascript"}


def in_chromium(sizes: dict[str, int]) -> dict[str, float]:
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Pages, directory=str(ROOT))) as pages, chromium() as browser:
        threading.Thread(target=pages.serve_forever, daemon=True).start()
        page = browser.new_page()
        page.goto(f"http://127.0.0.1:{pages.server_port}/")
        found: dict[str, float] = page.evaluate(RUN, sizes)
        pages.shutdown()
    return found


def node(*words: str) -> Any:
    done = subprocess.run(["node", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def in_node(sizes: dict[str, int]) -> dict[str, float]:
    found: dict[str, float] = node("--input-type=module", "-e", NODE.replace("SIZES", json.dumps(sizes)))
    return found


def in_python(address: str, hull: str, seconds: float) -> float:
    dice, keys, rows = np.random.default_rng(1), np.arange(ROWS, dtype=np.uint64), 0
    with HullClient(address) as client, client.writer(hull) as writer:
        begun = time.perf_counter()
        while time.perf_counter() - begun < seconds:
            writer.put(keys=keys, points=dice.random((ROWS, 2)))
            rows += ROWS
        writer.flush()
        return rows / (time.perf_counter() - begun)


def copies(sizes: dict[str, int]) -> None:
    print("where\tlocate ns\ton edges ns\torient2d ns\ton edges ns\tchanges/s\tand asked/s")
    for where, measure in (("Node", in_node), ("Chromium", in_chromium)):
        found = measure(sizes)
        values = (found[name] for name in ("locate", "beside", "predicate", "predicateBeside", "events", "eventsAsked"))
        print(where, *(f"{value:,.0f}" for value in values), sep="\t")


def writers(seconds: float, rounds: int) -> None:
    rates: dict[str, list[float]] = {"Python": [], "Node, gRPC": [], "Node, gateway": []}
    with server_process("--in-memory") as server, gateway_process(server.address) as gateway:
        script = str(ROOT / "benchmarks" / "writer.mjs")
        with HullClient(server.address) as client:
            client.create_hull("written", keyed="int")
        for _ in range(rounds):
            rates["Python"].append(in_python(server.address, "written", seconds))
            rates["Node, gRPC"].append(node(script, f"grpc://{server.address}", "written", str(seconds)))
            rates["Node, gateway"].append(node(script, gateway.url, "written", str(seconds)))
    print("\nwriter\trows/s")
    for name, found in rates.items():
        print(f"{name}\t{median(found):,.0f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, default=10_000)
    parser.add_argument("--points", type=int, default=200_000)
    parser.add_argument("--events", type=int, default=20_000)
    parser.add_argument("--seconds", type=float, default=3)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    copies({"vertices": given.vertices, "points": given.points, "events": given.events})
    writers(given.seconds, given.rounds)


if __name__ == "__main__":
    main()
