"""Flies a day of 2013 through the hull "fleet": a minute of it every tenth of a second."""

import argparse
import time
from datetime import date
from itertools import islice

from dynhull_cli.demo.flights import Flights
from dynhull_client import HullClient, HullExistsError

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--address", default="127.0.0.1:50051")
parser.add_argument("--minutes", type=int, default=1440)
parser.add_argument("--pause", type=float, default=0.1, help="seconds between two minutes of the day")
options = parser.parse_args()

with HullClient(options.address) as client:
    try:
        client.create_hull("fleet")
    except HullExistsError:
        client.delete_hull("fleet")  # yesterday's
        client.create_hull("fleet")
    before = None
    for frame in islice(Flights(date(2013, 3, 8)).frames(), options.minutes):
        client.apply("fleet", delete=before, insert=frame.positions)  # one batch: nobody sees half of a minute
        before = frame.positions
        print(f"\r{frame.clock}  {len(before)} in the air", end="", flush=True)
        time.sleep(options.pause)
print()
