"""`dynhull load` reads the sentences of GPS receivers."""

import gzip
from fractions import Fraction
from functools import reduce
from operator import xor

import pytest
from command_line import dynhull

from dynhull_cli.reading.nmea import position
from dynhull_client import HullClient

GGA = "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47"


def sentence(data):
    return f"${data}*{reduce(xor, data.encode()):02x}"


def test_a_log(tmp_path, served, name):
    lines = [
        GGA,
        "$GPGSV,2,1,08,01,40,083,46,02,17,308,41,12,07,344,39,14,22,228,45*75",
        "",
        f"\\s:r17,c:1240804800*5A\\{sentence('GPRMC,225446,A,4916.45,N,00311.12,W,000.5,054.7,191194,020.3,E')}",
        sentence("GNGGA,,3351.64830,S,01512.93000,E,4,12,0.5,1,M,0,M,,"),
        "!AIVDM,1,1,,A,13u?etPv2;0n:dDPwUM1U1Cb069D,0*24",
        "$PGRME,15.0,M,45.0,M,25.0,M*1C",
        GGA.replace("4807", "4907"),
        GGA[:40],
        sentence("GPGGA,,,,,,0,00,,,M,,M,,"),
        sentence("GPRMC,225446,V,4916.45,N,12311.12,W,,,191194,,"),
        sentence("GPGGA,1,9107.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"),
        sentence("GPGGA,1,4860.000,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"),
        sentence("GPGGA,1,4807.038,E,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"),
        sentence("GPGGA,1,48x7.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"),
        sentence("GPGGA,1,807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"),
        sentence("GPRMC,225446,A"),
        "anything",
        "\xff\x00",
    ]
    text = "\r\n".join(lines).encode("latin-1")
    (tmp_path / "ride.nmea").write_bytes(text)
    (tmp_path / "ride.log.gz").write_bytes(gzip.compress(text))
    bad = tmp_path / "bad.csv"
    done = dynhull("load", name, tmp_path / "ride.nmea", "--bad-rows", bad)
    assert (done.exit_code, done.stdout) == (0, f"{name}: 3 points loaded, 3 in the hull\n"), done.stderr
    reasons = [line.split(",", 1)[1].strip('"') for line in bad.read_text("latin-1").splitlines()[1:]]
    for reason, words in zip(
        reasons,
        [
            "the checksum is '47', and that of the sentence is 46",
            "the sentence has no checksum: is it cut?",
            "the receiver had no fix",
            "the receiver had no fix",
            "the latitude is '9107.038,N', not up to 90 degrees and 60 minutes",
            "the latitude is '4860.000,N', not up to 90 degrees and 60 minutes",
            *3 * ["the latitude is '"],
            "the sentence has 3 fields: RMC has more",
            *2 * ["not a sentence of NMEA: it does not begin with $"],
        ],
        strict=True,
    ):
        assert reason.startswith(words)
    again = dynhull("load", name, tmp_path / "ride.log.gz", "--format", "nmea", "--again", "--dry-run")
    assert "3 points would be loaded, x from -3.1853333333333333 to 15.2155," in again.stdout
    with HullClient(served) as client:
        assert client.get_hull(name).info.geographic
        assert client.count(name, [(11 + 31 / 60, 48 + 7.038 / 60)]).counts.tolist() == [1]
    assert "--key is for" in dynhull("load", f"{name}-2", tmp_path / "ride.nmea", "--key", "a").stderr


def test_degrees_are_rounded_once():
    for minutes in "00", "07.038", "07.", "59.99999999999999999999", "33.3333333333333333333333":
        found = position(sentence(f"GPGGA,1,48{minutes},N,01131.000,E,1,8,,,M,,M,,"))
        assert found == (11 + 31 / 60, float(48 + Fraction(minutes.rstrip(".")) / 60))


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize("frame", ["--geographic", "--plane"])
def test_what_ais_has_not_is_a_bad_row_that_says_so(tmp_path, name, frame):
    file = tmp_path / "ships.csv"
    file.write_text("mmsi,lon,lat\n1,9.9,53.5\n2,181,91\n3,181.0,91.0\n")
    done = dynhull("load", name, file, "--key", "mmsi", "--dry-run", frame)
    assert done.stderr.count("the latitude is 91.0, which AIS writes where it is not available") == 2
