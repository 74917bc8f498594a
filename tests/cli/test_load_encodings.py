"""Text in any encoding: what is none of it is refused with its place, or kept byte for byte, and never replaced."""

import codecs
import csv
import gzip
import io
import json
import subprocess
from itertools import count

import pytest
from command_line import dynhull

from dynhull_client import HullClient

PEOPLE = "name,x,y\nMüller,0,0\nMöller,4,0\nMäller,4,4\nKrüger,0,4\n"
NAMES = ["Krüger", "Möller", "Müller", "Mäller"]
ROWS = [dict(zip(("name", "x", "y"), row.split(","), strict=True)) for row in PEOPLE.split()[1:]]
NDJSON = "".join(json.dumps({**row, "x": int(row["x"])}, ensure_ascii=False) + "\n" for row in ROWS)
GEOJSON = json.dumps(
    {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"name": row["name"]},
                "geometry": {"type": "Point", "coordinates": [int(row["x"]), int(row["y"])]},
            }
            for row in ROWS
        ],
    },
    ensure_ascii=False,
    indent=1,
)
LONG = "".join(f"vän {i},{i % 977},{i % 991}\r\n" for i in range(6_000))  # more than the readers hold at a time


def refused(*arguments, **more):
    done = dynhull(*arguments, **more)
    assert done.exit_code == 2, done.stderr
    return done.stderr


def keys(served, name):
    with HullClient(served) as client:
        return sorted(client.entities(name).keys)


@pytest.mark.parametrize(
    ("file", "text", "encoding", "options"),
    [
        ("a.csv", PEOPLE, "cp1252", ["--encoding", "cp1252"]),
        ("a.csv", PEOPLE, "latin-1", ["--encoding", "latin1"]),
        ("a.tsv", PEOPLE.replace(",", "\t"), "mac-roman", ["--encoding", "mac-roman"]),
        ("a.csv", PEOPLE, "utf-8-sig", []),
        ("a.csv", PEOPLE, "utf-8-sig", ["--encoding", "UTF-8"]),
        ("a.csv", PEOPLE, "utf-16", []),
        ("a.csv", "\ufeff" + PEOPLE, "utf-16-be", []),
        ("a.csv", PEOPLE, "utf-16-be", ["--encoding", "utf-16-be"]),
        ("a.csv", PEOPLE, "utf-32", []),
        ("a.ndjson", NDJSON, "cp1252", ["--encoding", "cp1252"]),
        ("a.ndjson", NDJSON, "utf-16", []),
        ("a.json", NDJSON, "utf-16", []),
        ("a.geojson", GEOJSON, "latin-1", ["--encoding", "latin-1", "--plane"]),
        ("a.geojson", "\ufeff" + GEOJSON, "utf-16-be", ["--plane"]),
    ],
    ids=count(),
)
def test_encodings(tmp_path, served, name, file, text, encoding, options):
    path = tmp_path / file
    path.write_bytes(text.encode(encoding))
    done = dynhull("load", name, path, "--key", "name", *options)
    assert done.exit_code == 0, done.stderr
    assert keys(served, name) == sorted(NAMES)


@pytest.mark.parametrize(
    ("file", "content", "place"),
    [
        ("a.csv", PEOPLE.encode("cp1252"), "line 2, character 2: the byte 0xfc is not UTF-8"),
        ("a.csv", "x,y,größe\n0,0,1\n".encode("cp1252"), "line 1, character 7: the byte 0xf6 is not UTF-8"),
        ("a.csv", "x,y,größe\n0,0,1\nä,1".encode() + b"\xc3", "line 3, character 4: the byte 0xc3 is not UTF-8"),
        ("a.csv.gz", gzip.compress(PEOPLE.encode("cp1252")), "line 2, character 2: the byte 0xfc is not UTF-8"),
        ("a.csv", b"x,y,a\n" + LONG.encode() + b"J\xf6rg", "line 6002, character 2: the byte 0xf6 is not UTF-8"),
        ("a.csv", b"x,y,a\r" + LONG.encode().replace(b"\r\n", b"\r") + b"J\xf6rg", "line 6002, character 2"),
        ("a.csv", ("x,y\n0,0\n1").encode("utf-16")[:-1], "line 3, character 1: the byte 0x31 is not UTF-16"),
        ("a.ndjson", NDJSON.encode("cp1252"), "line 1, character 12: the byte 0xfc is not UTF-8"),
        ("a.json", NDJSON.encode("cp1252"), "line 1, character 12: the byte 0xfc is not UTF-8"),
        ("a.geojson", GEOJSON.encode("cp1252"), "line 7, character 15: the byte 0xfc is not UTF-8"),
    ],
    ids=count(),
)
def test_other_bytes_are_refused_with_their_place(tmp_path, monkeypatch, name, file, content, place):
    monkeypatch.chdir(tmp_path)
    (tmp_path / file).write_bytes(content)
    said = refused("load", name, file, "--dry-run")
    assert f"{file}, {place}" in said
    assert "--encoding cp1252" in said


@pytest.mark.usefixtures("served")
def test_a_hull_is_not_made_of_what_is_refused(tmp_path, name):
    path = tmp_path / "people.csv"
    path.write_bytes(PEOPLE.encode("latin-1"))
    assert "character 2: the byte 0xfc" in refused("load", name, path, "--key", "name")
    assert "character 2: the byte 0xfc" in refused("load", name, "-", "--key", "name", input=path.read_bytes())
    assert dynhull("show", name).exit_code != 0


def test_what_was_loaded_before_the_place_stays_and_the_rest_follows(tmp_path, served, name):
    path = tmp_path / "people.csv"
    content = b"who,x,y\n" + 2 * LONG.encode() + "Jörg,-1,-1\n".encode("latin-1")
    path.write_bytes(content.replace("ä".encode(), b"a"))
    said = refused("load", name, path)
    advised = said[said.index("--producer") :].split()[:2]
    done = dynhull("load", name, path, "--encoding", "latin-1", "--resume", *[each.rstrip(".") for each in advised])
    assert done.exit_code == 0, done.stderr
    with HullClient(served) as client:
        assert client.get_hull(name).info.points == 12_001


@pytest.mark.parametrize("file", ["people.csv", "people.ndjson"])
def test_bad_rows_are_copied_as_they_are(tmp_path, served, name, file):
    path, kept = tmp_path / file, tmp_path / "bad.csv"
    text = PEOPLE if file.endswith("csv") else NDJSON
    path.write_bytes(text.replace("Krüger", "Kruger").encode("latin-1"))
    done = dynhull("load", name, path, "--key", "name", "--bad-rows", kept)
    assert done.exit_code == 0
    assert "3 bad rows left out" in done.stderr
    assert "its byte 0xfc is none of the encoding of the file" in done.stderr
    rows = list(csv.reader(io.StringIO(kept.read_bytes().decode("latin-1"))))[1:]
    lines = text.splitlines()
    assert [(place, row) for place, _, row in rows] == [
        (f"line {i}", each)
        for i, each in enumerate(lines, 1)
        if "ü" in each.replace("K", "") or "ö" in each or "ä" in each
    ][:3]
    with HullClient(served) as client:
        assert client.get_hull(name).info.points == 1


@pytest.mark.usefixtures("served")
def test_bytes_of_a_heading_or_a_document_are_no_bad_row(tmp_path, name):
    for file, content in (("a.csv", "x,y,größe\n0,0,1\n"), ("a.geojson", GEOJSON)):
        (tmp_path / file).write_bytes(content.encode("latin-1"))
        assert "line" in refused("load", name, tmp_path / file, "--bad-rows", tmp_path / "bad.csv")


def test_other_readers(tmp_path, served, name):
    with HullClient(served) as client:
        client.create_hull(name, keyed="str")
    assert "standard input, line 2, character 2: the byte 0xfc" in refused(
        "put", name, "-", input="Maier,1,1\nMüller,0,0\n".encode("latin-1")
    )
    assert dynhull("put", name, "-", input="\ufeffMüller,0,0\n".encode("utf-16-le")).exit_code == 0
    assert dynhull("query", name, "positions", input="Müller\n").exit_code == 0
    assert "standard input, line 1" in refused("query", name, "locate", "-", input=b"0,0 \xe4\n")
    area = tmp_path / "area.geojson"
    polygon = {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [0, 1], [0, 0]]], "name": "Nürnberg"}
    for encoding in ("latin-1", "utf-16"):
        area.write_bytes(json.dumps(polygon, ensure_ascii=False).encode(encoding))
        done = dynhull("fences", "create", name, "--polygon", area, "--subjects", name)
        if encoding == "utf-16":
            assert done.exit_code == 0, done.stderr
        else:
            assert "area.geojson, line 1, character " in done.stderr
            assert "iconv -f CP1252 -t UTF-8" in done.stderr
            subprocess.run(["iconv", "-f", "CP1252", "-t", "UTF-8", area, "-o", tmp_path / "utf8.geojson"], check=True)
            assert dynhull("fences", "create", f"{name}/a", "--polygon", tmp_path / "utf8.geojson", "--subjects", name)
    assert codecs.BOM_UTF16 in area.read_bytes()
