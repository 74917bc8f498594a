"""How fast the dashboard's page is: `python benchmarks/map.py`, in headless Chromium, without a graphics card.

First the paint: from the request for a page with ten hulls to the frame in which all ten are drawn. Then frames per
second while 2,000 keys with names move ten times a second and the picture is dragged without pause. Then a crowd: all
hulls of a prefix, some of which move, and how long it takes from a move of the pointer to the next frame, which has the
answer.
"""

import argparse
import os
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from statistics import median
from urllib.parse import urlencode

import numpy as np
from playwright.sync_api import sync_playwright

from dynhull_client import HullClient

SERVER = ["-m", "dynhull_server", "--port", "0", "--in-memory", "--log-level", "warning"]
DASHBOARD = ["-m", "dynhull_cli", "dashboard", "--port", "0", "--address"]
HULLS, ENTITIES, STEP = 10, 2_000, 0.05
WINDOW = {"viewport": {"width": 1440, "height": 900}}
SOFTWARE = ["--no-sandbox", "--disable-gpu"]
DRAWN = """hulls => picture.frames && picture.hulls.size == hulls
    && [...picture.hulls.values()].every(hull => hull.vertices.x.length) && performance.now()"""
FRAMES = """([seconds, drag]) => new Promise(resolve => {
    const pauses = [], begun = performance.now(), drawn = picture.frames
    let before
    const frame = now => {
        if (before) pauses.push(now - before)
        before = now
        if (drag) picture.move(view => view.pan(Math.cos((now - begun) / 500) * 4, 0))
        if (now - begun < 1000 * seconds) return requestAnimationFrame(frame)
        pauses.sort((one, two) => one - two)
        resolve({frames: pauses.length / (now - begun) * 1000, drawn: (picture.frames - drawn) / (now - begun) * 1000,
            median: pauses[pauses.length >> 1], slow: pauses[Math.floor(pauses.length * 0.95)]})
    }
    requestAnimationFrame(frame)
})"""

# From when the browser got the event to the frame behind its answer.
POINTED = """() => {
    globalThis.pauses = []
    picture.element.addEventListener("pointermove", ({timeStamp}) =>
        requestAnimationFrame(() => pauses.push(performance.now() - timeStamp)))
}"""
CORNER = """() => {
    const {hulls} = picture.many, {corners} = hulls[Math.floor(Math.random() * hulls.length)]
    const {x, y} = picture.element.getBoundingClientRect(), [across, down] = picture.view.place(...corners[0])
    return [x + across, y + down]
}"""
POINTS, MOVERS, SPREAD = 20, 4, 0.3


@contextmanager
def running(*command):
    with subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().split()[-1]
        finally:
            process.terminate()


def fill(client):
    generator = np.random.default_rng(1)
    for number in range(HULLS):
        client.create_hull(f"hull-{number}", keyed="str", geographic=True, center=(10, 50))
        places = generator.normal([10 + 3 * number, 50], 1.5, (100, 2))
        client.put(f"hull-{number}", [f"truck-{key}" for key in range(100)], places)
    client.create_hull("fleet", keyed="str", geographic=True, center=(-95, 38))


def move(client, stop):
    generator = np.random.default_rng(2)
    keys = [f"truck-{key}" for key in range(ENTITIES)]
    places = generator.uniform([-120, 28], [-72, 48], (ENTITIES, 2))
    while not stop.wait(0.1):
        places += generator.normal(0, STEP, places.shape)
        client.put("fleet", keys, places)


def crowd(client, hulls):
    """Make them; returns their middles."""
    generator = np.random.default_rng(3)
    middles = generator.uniform([-120, 25], [140, 60], (hulls, 2))
    offsets = generator.normal(0, SPREAD, (hulls, POINTS, 2))

    def make(hull):
        client.create_hull(f"crowd/{hull}", geographic=True, center=tuple(middles[hull]))
        client.apply(f"crowd/{hull}", insert=middles[hull] + offsets[hull])

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(make, range(hulls)))
    return middles


def stir(client, middles, stop, moved, rate):
    """Add points to hulls of the crowd, as many a second as asked for, or as can be."""
    generator = np.random.default_rng(4)
    while not stop.is_set():
        begun = time.perf_counter()
        for hull in generator.integers(len(middles), size=max(1, rate // 10)):
            client.apply(f"crowd/{hull}", insert=[generator.normal(middles[hull], 2 * SPREAD)])
            moved.append(hull)
        stop.wait(max(0, 0.1 - (time.perf_counter() - begun)))


def point(client, browser, url, arguments):
    middles, stop, moved = crowd(client, arguments.crowd), threading.Event(), []
    movers = [
        threading.Thread(target=stir, args=(client, middles, stop, moved, arguments.moves // MOVERS))
        for _ in range(MOVERS)
    ]
    page = browser.new_context(**WINDOW).new_page()
    page.goto(f"{url}/?prefix=crowd/")
    there = "hulls => globalThis.picture?.many.hulls.length == hulls && performance.now()"
    came = page.wait_for_function(there, arg=arguments.crowd, timeout=0).json_value()  # what is measured
    for mover in movers:
        mover.start()
    try:
        page.evaluate(POINTED)
        begun = time.perf_counter()
        while time.perf_counter() < begun + arguments.seconds:
            page.mouse.move(*page.evaluate(CORNER))
            page.wait_for_timeout(20)
        took = time.perf_counter() - begun
        pauses = sorted(page.evaluate("pauses"))
    finally:
        stop.set()
        for mover in movers:
            mover.join()
    print(
        f"{arguments.crowd} hulls, there after {came / 1000:.1f} s, {len(moved) / took:.0f} of which move a second: "
        f"{len(pauses)} moves of the pointer, answered after {median(pauses):.0f} ms (median), "
        f"{pauses[int(0.95 * len(pauses))]:.0f} ms (95 %), {pauses[-1]:.0f} ms (most); load {os.getloadavg()[0]:.1f}"
    )


def draw(client, browser, url, arguments):
    stop = threading.Event()
    fill(client)
    painted, drawn = [], []
    for _ in range(arguments.pages):
        page = browser.new_context(**WINDOW).new_page()
        page.goto(f"{url}/?{urlencode([('hull', f'hull-{number}') for number in range(HULLS)])}")
        drawn.append(page.wait_for_function(DRAWN, arg=HULLS).json_value())
        painted.append(page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime"))
        page.context.close()
    print(f"medians of {arguments.pages}: first paint {median(painted):.0f} ms, ten hulls {median(drawn):.0f} ms")
    mover = threading.Thread(target=move, args=(client, stop))
    mover.start()
    try:
        page = browser.new_context(**WINDOW).new_page()
        page.goto(f"{url}/?hull=fleet")
        page.wait_for_function(f"() => picture.hulls.get('fleet')?.points.x.length > {ENTITIES // 2}")
        for names in (False, True):
            page.get_by_label("All names").set_checked(names)
            for drag in (False, True):
                found = page.evaluate(FRAMES, [arguments.seconds, drag])
                shown = page.evaluate("picture.labels.shown.size")
                print(
                    f"{shown} names, {'dragged' if drag else 'at rest'}: {found['frames']:.0f} frames/s, of which "
                    f"{found['drawn']:.0f} drawn; median {found['median']:.1f} ms, 95 % {found['slow']:.1f} ms"
                )
    finally:
        stop.set()
        mover.join()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--pages", type=int, default=5)
    parser.add_argument("--crowd", type=int, default=10_000, help="hulls of a prefix; 0 for none")
    parser.add_argument("--moves", type=int, default=1000, help="of them, a second")
    parser.add_argument("--only-crowd", action="store_true")
    arguments = parser.parse_args()
    with (
        running(*SERVER) as address,
        running(*DASHBOARD, address) as url,
        HullClient(address) as client,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium") or shutil.which("chromium-headless-shell"), args=SOFTWARE
        )
        if not arguments.only_crowd:
            draw(client, browser, url, arguments)
        if arguments.crowd:
            point(client, browser, url, arguments)
        browser.close()


if __name__ == "__main__":
    main()
