"""What a page of the dashboard and its process hold after many events: `python benchmarks/endurance.py`.

A thousand vehicles enter and leave a fence together, a thousand events each time, until there have been a million.
A page in headless Chromium shows the hull, its prefix, the fence with its events, and an alarm. A line for each tenth:
the heap of the page after its garbage is collected, the text of the last five minutes that it keeps to go back to,
the heap without that text, and the resident memory of the dashboard. Ends with an error where the last two tenths
hold a tenth more than the third and the fourth; of the page, whose heap comes and goes with what it draws, a half.
"""

import argparse
import os
import shutil
import sys
import time
from pathlib import Path

from playwright.sync_api import sync_playwright
from workers import serving

from dynhull_client import HullClient

SERVER = ["-m", "dynhull_server", "--port", "0", "--in-memory", "--log-level", "warning"]
DASHBOARD = ["-m", "dynhull_cli", "dashboard", "--port", "0", "--address"]
VEHICLES, YARD = 1000, [[0, 0], [10, 0], [10, 10], [0, 10]]
LINES = 10


def resident(pid):
    """In megabytes."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def drive(client, keys, turn):
    """Into the yard, or out of it, each at a place of its own."""
    side = 20 * (turn % 2)
    places = [(side + 1 + (key % 40) / 5, 1 + (key // 40) / 5 + 0.001 * (turn % 97)) for key in range(VEHICLES)]
    client.put("fleet/one", keys, places)


def held(page, session, dashboard):
    session.send("HeapProfiler.collectGarbage")
    heap = session.send("Runtime.getHeapUsage")["usedSize"] / 1e6
    text = page.evaluate("recorder.length") / 1e6
    return [heap, text, heap - text, resident(dashboard)]


def endure(client, page, session, dashboard, events):
    keys = [f"van-{key}" for key in range(VEHICLES)]
    lines, turns = [], events // VEHICLES
    begun = time.perf_counter()
    for turn in range(1, turns + 1):
        drive(client, keys, turn)
        if turn % (turns // LINES) == 0:
            shown = page.locator(".events tbody tr").count()
            lines.append(held(page, session, dashboard))
            figures = "  ".join(f"{each:7.1f}" for each in lines[-1])
            sent = client.get_fence("yard").last_sequence
            print(f"{sent:>9}  {figures}  {shown} rows  {time.perf_counter() - begun:.0f} s", flush=True)
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--events", type=int, default=1_000_000)
    arguments = parser.parse_args()
    with (
        serving(SERVER) as (address, _),
        serving([*DASHBOARD, address]) as (url, dashboard),
        HullClient(address) as client,
        sync_playwright() as playwright,
    ):
        client.create_hull("fleet/one", keyed="str")
        client.create_fence("yard", area=YARD, subjects="fleet/one")
        client.create_alarm("away", hull="fleet/one", when="count > 1", clear="count < 1")
        chromium = shutil.which("chromium") or shutil.which("chromium-headless-shell")
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
        page.goto(f"{url}/?hull=fleet/one&prefix=fleet/&fence=yard")
        page.wait_for_function("() => globalThis.picture?.fences.has('yard')")
        print("   events  heap MB  text MB     rest  dashboard MB")
        lines = endure(client, page, page.context.new_cdp_session(page), dashboard, arguments.events)
        browser.close()
    for name, column, growth in (("page", 2, 1.5), ("dashboard", 3, 1.1)):
        early, late = (sum(line[column] for line in lines[part]) for part in (slice(2, 4), slice(-2, None)))
        print(f"{name}: {late / early:.2f} times as much at the end")
        if late > growth * early:
            sys.exit(f"the {name} grows")


if __name__ == "__main__":
    main()
