"""Make the screenshots of the dashboard with days of the demo's flights: `python docs/screenshots.py`.

Chromium, or its shell without a window, must be on the PATH.
"""

import shutil
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from urllib.parse import urlencode

from playwright.sync_api import sync_playwright

from dynhull_cli.demo.flights import Flights
from dynhull_client import Circle, HullClient

SERVE = ["serve", "--in-memory", "--port", "0", "--metrics-port", "0", "--log-level", "warning"]
UNITS = ["--x-unit", "km", "--y-unit", "km"]
DAYS = [date(2013, 3, 8), date(2013, 7, 11)]  # snow, and a summer's day
MORNING, EVENING, PACE = 8 * 60, 17 * 60, 0.1
IMAGES = Path(__file__).with_name("images")
DESK = {"viewport": {"width": 1440, "height": 900}}
WALL = {"viewport": {"width": 1920, "height": 1080}, "color_scheme": "dark"}
PHONE = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "is_mobile": True, "has_touch": True}
# Fences are around a hull of their own, so that the other pictures are without them.
FENCED = "airborne"
LIGHT, DARK = {"color_scheme": "light"}, {"color_scheme": "dark"}
PICTURES = {
    "dashboard.png": (DESK | LIGHT, False),
    "dashboard-dark.png": (DESK | DARK, False),
    "dashboard-phone.png": (PHONE | LIGHT, False),
    "dashboard-fences.png": (DESK | LIGHT, True),
}

# Taken last: an alarm is raised, which the other pictures are without.
ALARM = {"prefix": "flights/", "when": "area > 1000 km2"}


@contextmanager
def running(*arguments, lines=1):
    """Run a dynhull command; yields the addresses it prints."""
    command = [sys.executable, "-m", "dynhull_cli", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield [process.stdout.readline().split()[-1] for _ in range(lines)]
        finally:
            process.terminate()


def fly(client, scene, name):
    for frame in list(scene.frames())[MORNING:EVENING]:
        client.put(name, frame.keys, frame.points, remove=frame.removed)
        time.sleep(PACE)


def main():
    scenes = [Flights(day) for day in DAYS]
    with (
        running(*SERVE, lines=2) as (address, metrics),
        running("dashboard", "--address", address, "--metrics", metrics, "--port", "0", *UNITS) as (url,),
        HullClient(address) as client,
        sync_playwright() as playwright,
    ):
        flown = [*((scene, scene.hull_name) for scene in scenes), (scenes[-1], FENCED)]
        for _, name in flown:
            client.create_hull(name, keyed="str", geographic=True, center=scenes[0].center)
        for name, circle in scenes[-1].circles.items():
            client.create_fence(name, Circle(*circle), FENCED)
        chromium = shutil.which("chromium") or shutil.which("chromium-headless-shell")
        flights = [threading.Thread(target=fly, args=(client, scene, name)) for scene, name in flown]
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        plain = [("hull", scene.hull_name) for scene in scenes]
        fenced = [("fence", name) for name in scenes[-1].circles]
        pages = {name: browser.new_context(**look).new_page() for name, (look, _) in PICTURES.items()}
        for name, page in pages.items():
            page.goto(f"{url}/?{urlencode(fenced if PICTURES[name][1] else plain)}")
        for flight in flights:
            flight.start()
        time.sleep((EVENING - MORNING) * PACE - 4)
        for name, page in pages.items():
            page.screenshot(path=IMAGES / name)
        client.create_alarm("spread", **ALARM)
        wall = browser.new_context(**WALL).new_page()
        wall.goto(f"{url}/?kiosk&prefix=flights/")
        wall.get_by_text("Acknowledge").first.wait_for()
        wall.wait_for_function("() => picture.many.hulls.length == 2 && picture.coasts.known.size")
        time.sleep(2)
        wall.screenshot(path=IMAGES / "dashboard-wall.png")
        for flight in flights:
            flight.join()
        browser.close()


if __name__ == "__main__":
    main()
