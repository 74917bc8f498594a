"""The TypeScript package: its own tests with a real gateway, kills, its types, a page, and the cases that it shares."""

import gzip
import json
import os
import shutil
import signal
import subprocess
import tarfile
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from cases import slow
from chromium import chromium
from gateway_process import Gateway, gateway_process
from mortal_server import MortalServer
from peers import program, typescript
from playwright.sync_api import Browser, Page, expect
from ports import free_port
from run_in import run
from server_process import PATIENCE, server_process

from dynhull import DynamicHull
from dynhull_client import HullClient, HullCopy, Snapshot

HERE = Path(__file__).parent
KILLS = 1
FEW, MANY = 20_000, 1_000_000  # points
ONE_SCRIPT = 60_000  # bytes, compressed
CASES = json.loads((HERE.parents[1] / "clients" / "typescript" / "test" / "cases.json").read_text())
DEPENDENCIES = "lossless-json", "robust-predicates", "d3-geo", "d3-array", "internmap", "topojson-client"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MortalServer]:
    server = MortalServer(tmp_path_factory.mktemp("typescript"))
    yield server
    server.kill()


@pytest.fixture(scope="module")
def gateway(server: MortalServer) -> Iterator[Gateway]:
    with gateway_process(server.address, "--origin", "*") as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


def node(*words: str, **environment: str) -> str:
    """What a program of Node prints in the package's folder."""
    return run(program("node"), *words, folder=typescript(), **environment)


def blocks(kind: str) -> list[str]:
    """The blocks of a kind on the page about the package."""
    text = (HERE.parents[1] / "docs" / "how-to" / "typescript.md").read_text()
    return [block.partition("```")[0] for block in text.split(f"```{kind}\n")[1:]]


@slow
def test_its_own_tests(gateway: Gateway, server: MortalServer) -> None:
    said = node("--test", "--test-reporter=tap", DYNHULL_GATEWAY=gateway.url, DYNHULL_SERVER=f"grpc://{server.address}")
    assert "\n# fail 0\n" in said
    assert "\n# skipped 0\n" in said


@slow
def test_it_packs(tmp_path: Path) -> None:
    """What is packed and installed in an empty folder runs, and its types are those that a strict program needs."""
    pack = program("npm"), "pack", "--silent", "--offline", "--pack-destination", str(tmp_path)
    packed = run(*pack, folder=typescript()).strip()
    installed = tmp_path / "node_modules" / "dynhull"
    with tarfile.open(tmp_path / packed) as archive:
        archive.extractall(tmp_path, filter="data")
    (tmp_path / "node_modules").mkdir()
    (tmp_path / "package").rename(installed)
    locked = json.loads((typescript() / "package-lock.json").read_text())["packages"]
    for path in (each for each, about in locked.items() if each and not {"dev", "peer"} & about.keys()):
        shutil.copytree(typescript() / path, tmp_path / path)
    licences = (installed / "LICENSES.md").read_text()
    assert all(Path(path).name in licences for path in locked if (tmp_path / path).is_dir() and path)
    assert (installed / "LICENSE").read_text() == (HERE.parents[1] / "LICENSE").read_text()
    for name in ("program.mjs", "program.ts", "tsconfig.json"):
        shutil.copy(HERE / "installed" / name, tmp_path)
    assert run(program("node"), "program.mjs", folder=tmp_path) == "6 1\n"
    run(str(typescript() / "node_modules" / ".bin" / "tsc"), folder=tmp_path)


def test_python_has_the_same_cases() -> None:
    for case in CASES["hulls"]:
        vertices = np.array(case["vertices"], float).reshape(-1, 2)
        copy = HullCopy()
        copy.update(Snapshot(1, len(vertices), vertices, None))
        assert copy.locate(case["points"]).tolist() == case["sides"]
        told = [np.inf if each is None else each for each in case["distances"]]
        assert copy.distance(case["points"]).tolist() == told
        if len(vertices):
            assert copy.support(case["directions"]).tolist() == case["support"]


def test_python_has_the_same_values(server: MortalServer) -> None:
    name, values = "typescript/values", CASES["values"]
    keys = np.array(values["keys"], np.uint64)
    with HullClient(server.address) as client:
        client.create_hull(name, keyed="int", ordering="event_time")
        for step, batch in enumerate(values["batches"]):
            times = np.array(batch["times"], "datetime64[us]")
            applied = client.put(
                name, keys[:-1], batch["points"], times, producer="cases", sequence=batch["sequence"], may_skip=True
            )
            assert applied.revision == step + 1
            assert client.last_sequence(name, "cases") == batch["sequence"]
            found = client.positions(name, keys)
            kept = np.array(batch["points"], float) + 0.0  # -0.0 is 0.0 to a server
            assert found.positions[:-1].tobytes() == kept.tobytes()
            assert found.present.tolist() == [True] * len(times) + [False]
            assert found.times is not None
            assert np.array_equal(found.times[:-1], times)
            assert np.array_equal(np.sort(client.entities(name).keys), keys[:-1])


def test_python_gathers_the_same_batches(server: MortalServer) -> None:
    for place, case in enumerate(CASES["writers"]):
        name = f"typescript/gathered/{place}"
        with HullClient(server.address) as client:
            client.create_hull(name, keyed="str", ordering=case["ordering"])
            with client.writer(name, coalesce=case["coalesce"], linger=PATIENCE) as writer:
                outcomes = [writer.put(**call) for call in case["calls"]]
            assert [each.result().revision for each in outcomes] == case["revisions"], place
            assert writer.sequence == case["revisions"][-1]
            assert client.positions(name, list(case["kept"])).positions.tolist() == list(case["kept"].values())


@pytest.mark.parametrize(
    "count", [FEW, pytest.param(MANY, marks=[pytest.mark.long, pytest.mark.only_with("LANGUAGES_CASES")])]
)
def test_points_beside_edges(count: int, tmp_path: Path) -> None:
    """Each verdict beside edges is that of the library."""
    dice = np.random.default_rng(41)
    angles = np.sort(dice.uniform(0, 2 * np.pi, 300))
    hull = DynamicHull(np.column_stack([np.cos(angles), np.sin(angles)]) * 10 + 3)
    vertices = hull.vertices()
    edges, part = dice.integers(len(vertices), size=count), dice.uniform(size=(count, 1))
    points = vertices[edges] * part + np.roll(vertices, -1, axis=0)[edges] * (1 - part)
    points += np.spacing(points) * dice.integers(-3, 4, size=points.shape)
    points[: len(vertices)] = vertices
    for name, array in (("vertices", vertices), ("points", points)):
        (tmp_path / name).write_bytes(array.astype("<f8").tobytes())
    found = node(str(HERE / "locate.mjs"), str(tmp_path))
    sides = np.frombuffer(bytes.fromhex(found), np.int8)
    expected = hull.locate(points)
    assert len({*expected.tolist()}) == 3
    assert np.array_equal(sides, expected)


@slow
@pytest.mark.parametrize("way", ["gateway", "grpc"])
def test_a_writer_and_a_watch_outlive_servers(way: str, server: MortalServer, gateway: Gateway) -> None:
    name = f"typescript/kills/{way}"
    url = gateway.url if way == "gateway" else f"grpc://{server.address}"
    command = [program("node"), str(HERE / "outlives.mjs"), url, name]
    with subprocess.Popen(command, cwd=typescript(), stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        for _ in range(KILLS):
            for _ in range(80):
                running.stdout.readline()  # a line for each event of the watch, and for each acknowledgement
            server.kill()
            server.start()
        said = json.loads(running.stdout.read().splitlines()[-1])
        assert running.wait(PATIENCE) == 0
    with HullClient(server.address) as client:
        hull = client.get_hull(name)
        assert hull.revision == said["sequence"], "a batch was applied twice, or not at all"
        assert hull.vertices.tolist() == said["vertices"]
        assert hull.info.points == said["keys"]


@slow
@pytest.mark.parametrize("way", ["gateway", "grpc"])
def test_what_is_aborted_ends_with_the_reason(way: str, server: MortalServer, gateway: Gateway) -> None:
    """At whichever turn it is aborted; and no promise is left that rejects unseen."""
    url = gateway.url if way == "gateway" else f"grpc://{server.address}"
    assert node(str(HERE / "aborted.mjs"), url, f"typescript/aborted/{way}") == "[]\n"


@slow
@pytest.mark.parametrize("way", ["gateway", "grpc"])
def test_what_reads_a_damaged_past_ends_with_the_reason(way: str, tmp_path: Path) -> None:
    """Who began anew at each end would do so for ever."""
    complaints = "a part of the past cannot be read"
    with server_process("--data", str(tmp_path), complaints=complaints) as server, HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str", history=True)
        client.put("fleet", ["a", "b"], [(0, 0), (1, 1)])
        client.remove("fleet", ["b"])
        client.erase_history("fleet", ["b"])  # which makes segments of what the journal has
        for file in tmp_path.rglob("*.batches.parquet"):
            file.unlink()
        with gateway_process(server.address) as gateway:
            url = gateway.url if way == "gateway" else f"grpc://{server.address}"
            assert json.loads(node(str(HERE / "damaged.mjs"), url, "fleet")) == ["PAST_DAMAGED"] * 3


@slow
@pytest.mark.parametrize("way", ["gateway", "grpc"])
def test_batches_under_way_outlive_servers_and_gateways(way: str, server: MortalServer) -> None:
    """Each is applied once, in its turn, whatever is killed while several of them are under way."""
    name, port = f"typescript/pipelined/{way}", free_port()
    url = f"http://127.0.0.1:{port}" if way == "gateway" else f"grpc://{server.address}"
    command = [program("node"), str(HERE / "pipelined.mjs"), url, name]
    with ExitStack() as gateways:
        gateway = gateways.enter_context(gateway_process(server.address, "--port", str(port), killed=way == "gateway"))
        with subprocess.Popen(command, cwd=typescript(), stdout=subprocess.PIPE, text=True) as running:
            assert running.stdout is not None
            for victim in ("server", "gateway", "server")[:: 1 if way == "gateway" else 2]:
                for _ in range(40):
                    running.stdout.readline()
                if victim == "server":
                    server.kill()
                    server.start()
                else:
                    assert gateway.process is not None
                    gateway.process.kill()
                    gateway.process.wait(PATIENCE)
                    gateway = gateways.enter_context(gateway_process(server.address, "--port", str(port)))
            said = json.loads(running.stdout.read().splitlines()[-1])
            assert running.wait(PATIENCE) == 0
    with HullClient(server.address) as client:
        hull, kept = client.get_hull(name), dict(said["kept"])
        assert hull.revision == said["sequence"] == client.last_sequence(name, "pipelined")
        assert hull.info.points == len(kept)
        keys = np.array(list(kept), np.uint64)
        assert client.positions(name, keys).positions.tolist() == list(kept.values())


def test_what_the_page_of_documentation_says(gateway: Gateway, server: MortalServer) -> None:
    first, watching, writing = blocks("js")
    (over_grpc,) = blocks('js title="grpc.mjs"')
    ended = watching.replace("console.log(", "if (event.type === 'snapshot') break\n  console.log(")
    program = (
        (first + ended + writing).replace("http://127.0.0.1:8080", gateway.url).replace('"dynhull"', '"./src/index.js"')
    )
    over_grpc = over_grpc.replace("127.0.0.1:50051", server.address).replace("dynhull/grpc", "./src/grpc/index.js")
    node("--input-type=module", "-e", program + "console.assert(sides[0] === 1)")
    assert node("--input-type=module", "-e", over_grpc) == "[ [ 9, 50 ] ]\n"
    with HullClient(server.address) as client:
        assert client.positions("fleet", ["LH400"]).positions.tolist() == [[9, 50]]


@contextmanager
def served(folder: Path, gateway: Gateway, page: str) -> Iterator[str]:
    """The URL of a page of the documentation, in a folder with the installed package."""
    (text,) = blocks(f'html title="{page}"')
    (folder / page).write_text(
        text.replace("http://127.0.0.1:8080", gateway.url).replace("fleet", f"typescript/{page}")
    )
    (folder / "node_modules").mkdir()
    for package in DEPENDENCIES:
        (folder / "node_modules" / package).symlink_to(typescript() / "node_modules" / package)
    (folder / "node_modules" / "dynhull").symlink_to(typescript())

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            return

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder))) as pages:
        serving = threading.Thread(target=pages.serve_forever)
        serving.start()
        try:
            yield f"http://127.0.0.1:{pages.server_port}/{page}"
        finally:
            pages.shutdown()
            serving.join()


def watched(browser: Browser, loaded: list[bytes] | None = None) -> tuple[Page, list[str]]:
    """A page, and the errors in it."""
    seen, errors = browser.new_page(), list[str]()
    seen.on("pageerror", lambda error: errors.append(str(error)))
    if loaded is not None:
        seen.on("response", lambda response: loaded.append(response.body()) if response.url.endswith(".js") else None)
    return seen, errors


def test_a_page_with_a_live_hull(browser: Browser, gateway: Gateway, server: MortalServer, tmp_path: Path) -> None:
    name = "typescript/index.html"
    loaded: list[bytes] = []
    with served(tmp_path, gateway, "index.html") as url, HullClient(server.address) as client:
        client.create_hull(name)
        seen, errors = watched(browser, loaded)
        seen.goto(url)
        client.apply(name, insert=[(0, 0), (4, 0), (4, 3)])
        seen.wait_for_function("document.title === 'revision 1: area 6'")
        client.apply(name, insert=[(0, 3)])
        seen.wait_for_function("document.title === 'revision 2: area 12'")
        assert seen.locator("polygon").get_attribute("points") == "0,0 4,0 4,3 0,3"
        assert errors == []
        seen.close()
    assert sum(len(gzip.compress(each)) for each in loaded) <= ONE_SCRIPT


def signalled(processes: list[int], what: signal.Signals) -> None:
    for each in processes:
        with suppress(ProcessLookupError):
            os.kill(each, what)


@slow
def test_a_page_that_slept_goes_on(browser: Browser, server: MortalServer, tmp_path: Path) -> None:
    """A page whose processes stood still, while both the server and the gateway were killed, shows what is now."""
    name, port = "typescript/index.html", free_port()
    with ExitStack() as stack:
        gateway = stack.enter_context(
            gateway_process(server.address, "--port", str(port), "--origin", "*", killed=True)
        )
        url = stack.enter_context(served(tmp_path, gateway, "index.html"))
        client = stack.enter_context(HullClient(server.address))
        client.create_hull(name, exist_ok=True)
        revision = client.get_hull(name).revision
        seen, errors = watched(browser)
        seen.goto(url)
        client.apply(name, insert=[(0, 0), (8, 0), (8, 3)])
        seen.wait_for_function(f"document.title.startsWith('revision {revision + 1}:')")
        about = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")["processInfo"]
        renderers = [each["id"] for each in about if each["type"] == "renderer"]
        assert renderers
        stack.callback(signalled, renderers, signal.SIGCONT)
        signalled(renderers, signal.SIGSTOP)
        assert gateway.process is not None
        gateway.process.kill()
        gateway.process.wait(PATIENCE)
        server.kill()
        server.start()
        client.apply(name, insert=[(0, 30)])
        stack.enter_context(gateway_process(server.address, "--port", str(port), "--origin", "*"))
        signalled(renderers, signal.SIGCONT)
        seen.wait_for_function(f"document.title.startsWith('revision {revision + 2}:')")
        assert seen.locator("polygon").get_attribute("points") == "0,0 8,0 8,3 0,30"
        assert errors == []
        seen.close()
        client.delete_hull(name)


# The share of the pixels of the map that have about the colour.
INKED = """colour => {
    const [, things] = document.querySelector("dynhull-map").shadowRoot.querySelectorAll("canvas")
    const {data} = things.getContext("2d").getImageData(0, 0, things.width, things.height)
    const [red, green, blue] = [1, 3, 5].map(at => parseInt(colour.slice(at, at + 2), 16))
    let found = 0
    for (let i = 0; i < data.length; i += 4)
        found += data[i + 3] > 200 && Math.hypot(data[i] - red, data[i + 1] - green, data[i + 2] - blue) < 30
    return found
}"""
HULL, FENCE, ALARM = "#0072B2", "#7F3BD6", "#D0342C"
HULL_BY_NIGHT, PAPER, PAPER_BY_NIGHT = "#3D9BE0", "rgb(255, 255, 255)", "rgb(18, 22, 27)"


def by_night(seen: Page) -> None:
    """By night where the system has it, unless the attribute says otherwise: ground and hulls have other colours."""
    ground = "getComputedStyle(document.querySelector('dynhull-map').shadowRoot.querySelector('.map')).backgroundColor"
    element = "document.querySelector('dynhull-map')"
    for system, chosen, dark in (
        ("dark", "", True),
        ("dark", "day", False),
        ("light", "night", True),
        ("light", "", False),
    ):
        seen.emulate_media(color_scheme=system)
        seen.evaluate(f"chosen => {element}.setAttribute('look', chosen)", chosen)
        assert seen.evaluate(ground) == (PAPER_BY_NIGHT if dark else PAPER)
        seen.wait_for_function(f"({INKED})('{HULL_BY_NIGHT if dark else HULL}') > 200")


@slow
def test_a_map_of_a_hull_a_fence_and_an_alarm(
    browser: Browser, gateway: Gateway, server: MortalServer, tmp_path: Path
) -> None:
    name = "typescript/map.html"
    with served(tmp_path, gateway, "map.html") as url, HullClient(server.address) as client:
        client.create_hull(name, keyed="str")
        client.create_fence("yard", [(2, -1), (9, -1), (9, 9), (2, 9)], subjects=name, margin=3)
        client.create_alarm("spread", hull=name, when="area > 100")
        client.put(name, list("abc"), [(0, 0), (4, 0), (4, 3)])
        seen, errors = watched(browser)
        streams: list[str] = []
        seen.on("request", lambda request: streams.append(request.url) if request.url.endswith("/streams") else None)
        seen.goto(url)
        seen.wait_for_function("document.title === 'revision 1'")
        for colour in (HULL, FENCE):
            seen.wait_for_function(f"({INKED})('{colour}') > 200")
        # A line of dashes at the margin is more than the area's own border and the name.
        assert seen.evaluate(INKED, FENCE) > seen.evaluate(INKED, HULL) > 200
        assert seen.evaluate(INKED, ALARM) == 0
        by_night(seen)
        client.put(name, ["c"], [(4, 90)])
        shown = seen.locator("dynhull-map .alarms li")
        expect(shown).to_have_text(f"▲ spread: {name}, 180", timeout=PATIENCE * 1000)
        seen.wait_for_function(f"({INKED})('{ALARM}') > 200")
        client.put(name, ["c"], [(4, 3)])
        expect(shown).to_have_count(0, timeout=PATIENCE * 1000)
        seen.wait_for_function(f"({INKED})('{HULL}') > 200")
        server.kill()
        server.start()
        client.put(name, ["d"], [(0, 3)])
        seen.wait_for_function("document.title === 'revision 4'")
        seen.evaluate("document.querySelector('dynhull-map').setAttribute('hull', '')")
        seen.wait_for_function(f"({INKED})('{HULL}') === 0")
        assert len(streams) == 1, "all that the map follows is to take one connection"
        assert errors == []
        seen.close()
        client.delete_alarm("spread")
        client.delete_fence("yard")
