"""How fast the dashboard's page is: `python benchmarks/map.py`, in headless Chromium, without a graphics card.

First the paint: from the request for a page with ten hulls to the frame in which all ten are drawn. Then frames per
second while 2,000 keys with names move ten times a second and the picture is dragged without pause.
"""

import argparse
import shutil
import subprocess
import sys
import threading
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


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--pages", type=int, default=5)
    arguments = parser.parse_args()
    stop = threading.Event()
    with (
        running(*SERVER) as address,
        running(*DASHBOARD, address) as url,
        HullClient(address) as client,
        sync_playwright() as playwright,
    ):
        fill(client)
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=SOFTWARE)
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
        browser.close()


if __name__ == "__main__":
    main()
