"""`dynhull load` reads the files of GIS, GPS devices and Excel, layer by layer."""

import gzip
import sys
import zipfile
from collections.abc import Sequence

import numpy as np
import pyogrio
import pytest
import shapely
from command_line import dynhull

from dynhull_client import HullClient

pytestmark = pytest.mark.usefixtures("served")

PLACES = np.random.default_rng(3).uniform(-1, 1, (50, 2)) / [3, 7] + [13, 52]
NAMES = [f"k{i}" for i in range(len(PLACES))]
TIMES = [f"2026-01-01T00:00:{i:02}.25Z" for i in range(len(PLACES))]
KEYS = ["--key", "id", "--time", "seen"]
WRITTEN = [".gpkg", ".shp", ".fgb"]
SHEET = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"
DOCUMENT = "application/vnd.openxmlformats-officedocument"
RELATIONS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"


def write(path, geometries, crs="EPSG:4326", layer="places", kind="Point", **fields):
    pyogrio.raw.write(
        str(path),
        np.array([None if each is None else shapely.to_wkb(each) for each in geometries], object),
        [np.array(each, object) for each in fields.values()],
        list(fields),
        layer=path.stem if path.suffix == ".shp" else layer,
        geometry_type=kind,
        crs=crs,
        append=path.exists(),
        **({"SPATIAL_INDEX": "NO"} if path.suffix == ".fgb" else {}),
    )
    return path


def gpx(path, kind="wpt"):
    points = "".join(
        f'<{kind} lat="{y!r}" lon="{x!r}"><time>{time}</time><name>{name}</name></{kind}>'
        for (x, y), time, name in zip(PLACES.tolist(), TIMES, NAMES, strict=True)
    )
    if kind == "trkpt":
        points = f"<trk><trkseg>{points}</trkseg></trk>"
    path.write_text(f'<gpx version="1.1" creator="me" xmlns="http://www.topografix.com/GPX/1/1">{points}</gpx>')
    return path


def kml(path):
    marks = "".join(
        f"<Placemark><name>{name}</name><Point><coordinates>{x!r},{y!r},7</coordinates></Point></Placemark>"
        for (x, y), name in zip(PLACES.tolist(), NAMES, strict=True)
    )
    path.write_text(f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{marks}</Document></kml>')
    return path


def xlsx(path, rows: Sequence[Sequence[object]]):
    """What Excel writes, but for styles."""

    def cell(value):
        return f'<c t="inlineStr"><is><t>{value}</t></is></c>' if isinstance(value, str) else f"<c><v>{value!r}</v></c>"

    def typed(part, kind):
        return f'<Override PartName="{part}" ContentType="{DOCUMENT}.spreadsheetml.{kind}+xml"/>'

    def related(kind, target):
        relation = f'<Relationship Id="rId1" Type="{RELATIONS}/{kind}" Target="{target}"/>'
        return f'<Relationships xmlns="{PACKAGE}/relationships">{relation}</Relationships>'

    lines = "".join(f'<row r="{number}">{"".join(map(cell, row))}</row>' for number, row in enumerate(rows, start=1))
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{PACKAGE}/content-types">'
        + typed("/xl/workbook.xml", "sheet.main")
        + typed("/xl/worksheets/sheet1.xml", "worksheet")
        + "</Types>",
        "_rels/.rels": related("officeDocument", "xl/workbook.xml"),
        "xl/workbook.xml": f'<workbook xmlns="{SHEET}" xmlns:r="{RELATIONS}"><sheets>'
        '<sheet name="Fleet" sheetId="1" r:id="rId1"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": related("worksheet", "worksheets/sheet1.xml"),
        "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{SHEET}"><sheetData>{lines}</sheetData></worksheet>',
    }
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in parts.items():
            archive.writestr(name, text)
    return path


def made(path):
    """A file of this name with all places, their names and times."""
    match path.suffix:
        case ".gpx":
            return gpx(path), ["--key", "name", "--time", "time"]
        case ".kml":
            return kml(path), ["--key", "Name"]
        case ".xlsx":
            rows = [["id", "lon", "lat", "seen"], *map(list, zip(NAMES, *PLACES.T.tolist(), TIMES, strict=True))]
            return xlsx(path, rows), KEYS
        case ".zip":
            parts = write(path.with_suffix(".shp"), shapely.points(PLACES), id=NAMES, seen=TIMES)
            with zipfile.ZipFile(path, "w") as archive:
                for each in parts.parent.glob(f"{parts.stem}.*"):
                    if each != path:
                        archive.write(each, f"folder/{each.name}")
            return path, KEYS
    return write(path, shapely.points(PLACES), id=NAMES, seen=TIMES), KEYS


@pytest.mark.parametrize("suffix", [*WRITTEN, ".zip", ".gpx", ".kml", ".xlsx"])
def test_keys_and_places_bit_for_bit(tmp_path, served, name, suffix):
    file, keys = made(tmp_path / f"places{suffix}")
    done = dynhull("load", name, file, *keys)
    assert (done.exit_code, done.stdout) == (0, f"{name}: 50 points loaded, 50 in the hull\n"), done.stderr
    assert "a new hull on the globe" in done.stderr
    with HullClient(served) as client:
        found = client.entities(name)
    assert dict(zip(found.keys, found.points.tolist(), strict=True)) == dict(zip(NAMES, PLACES.tolist(), strict=True))


def read(name, file, *options):
    """What a load would do, without the line that no server answers."""
    done = dynhull("load", name, file, *options, "--dry-run")
    return done.exit_code, done.stderr + done.stdout


def test_a_layer_is_chosen(tmp_path, name):
    file = tmp_path / "city.gpkg"
    for layer, count in ("vans", 3), ("depots", 2), ("planned", 0):
        write(file, shapely.points(PLACES[:count]), layer=layer, id=NAMES[:count])
    assert read(name, file) == (2, f"error: {file} has several layers: choose one with --layer: vans, depots\n")
    assert read(name, file, "--layer", "bikes") == (
        2,
        f"error: {file} has no layer 'bikes'; it has vans, depots, planned\n",
    )
    assert read(name, file, "--layer", "planned")[1].startswith(f"error: {file} has no points")
    assert "2 points would be loaded" in read(name, file, "--layer", "depots")[1]
    track = gpx(tmp_path / "ride.gpx", "trkpt")
    code, said = read(name, track)
    assert (code, f"{track}: points from the layer track_points\n" in said, "50 points" in said) == (0, True, True)
    assert read(name, tmp_path / "none.gpkg") == (2, f"error: {tmp_path / 'none.gpkg'}: No such file or directory\n")


def test_geometries_that_are_no_points(tmp_path, name):
    file = tmp_path / "shapes.gpkg"
    geometries = [shapely.Point(1, 2, 3), None, shapely.Point(), shapely.box(0, 0, 1, 1), shapely.Point(3, 4)]
    write(file, geometries, kind="Unknown")
    code, said = read(name, file)
    assert (code, "2 points would be loaded, x from 1.0 to 3.0, y from 2.0 to 4.0" in said) == (0, True), said
    assert "3 bad rows left out:" in said
    assert "  feature 2: its geometry is missing\n" in said
    assert "  feature 4: its geometry is Polygon, not a Point (--vertices takes" in said
    assert read(name, file, "--max-bad", "2")[0] == 2
    assert "6 points would be loaded" in read(name, file, "--vertices")[1]
    bad = tmp_path / "bad.csv"
    assert read(name, file, "--bad-rows", bad, "--key", "fid")[0] == 0
    assert [line.partition(",")[0] for line in bad.read_text().splitlines()] == ["place"] + [
        f"feature {fid}" for fid in (2, 3, 4)
    ]


def test_which_world_the_layer_is_in(tmp_path, name):
    metres = write(tmp_path / "utm.gpkg", shapely.points([[4e5, 5e6]]), crs="EPSG:32633")
    assert "its coordinates are not degrees: its crs is WGS 84 / UTM zone 33N" in read(name, metres)[1]
    with pytest.warns(UserWarning, match="'crs' was not provided"):
        unknown = write(tmp_path / "any.gpkg", shapely.points([[4, 5]]), crs=None)
    assert "names no coordinate reference system: --geographic reads degrees" in read(name, unknown)[1]


@pytest.mark.parametrize("suffix", [*WRITTEN, ".gpx", ".kml", ".xlsx"])
def test_a_file_that_is_cut(tmp_path, name, suffix):
    file, _ = made(tmp_path / f"places{suffix}")
    for share in 0.97, 0.4:
        whole = file.read_bytes()
        file.write_bytes(whole[: int(len(whole) * share)])
        code, said = read(name, file)
        assert (code, said.startswith(f"error: {file}"), said.count("\n")) == (2, True, 1), said
        file.write_bytes(whole)
    for other in b"", b"anything", gzip.compress(b"anything"):
        file.write_bytes(other)
        code, said = read(name, file)
        assert (code, said.startswith(f"error: {file}"), said.count("\n")) == (2, True, 1), said


@pytest.mark.parametrize("suffix", ["gpkg", "fgb", "gpx", "kml", "xlsx"])
def test_what_is_called_otherwise_is_not_read(tmp_path, name, suffix):
    """GDAL would read it, and with it what it names: files of this machine, or of the network."""
    write(tmp_path / "places.shp", shapely.points(PLACES))
    source = f"<SrcDataSource>{tmp_path / 'places.shp'}</SrcDataSource>"
    file = tmp_path / f"other.{suffix}"
    file.write_text(f'<OGRVRTDataSource><OGRVRTLayer name="places">{source}</OGRVRTLayer></OGRVRTDataSource>')
    code, said = read(name, file)
    assert (code, said.partition(":")[0]) == (2, "error")
    assert f" is not {suffix}" in said


def test_coordinates_that_are_no_numbers(tmp_path, name):
    """GDAL takes them for 0."""
    track = gpx(tmp_path / "ride.gpx", "trkpt")
    for wrong in "x", "", "52,5", "5_2":
        track.write_text(track.read_text().replace('lat="', f'lat="{wrong}" was="', 1).replace("<trk>", "\n<trk>", 1))
        assert read(name, track) == (2, f"error: {track}, line 2: lat is {wrong!r}, not a number\n")
        gpx(track, "trkpt")
    marks = kml(tmp_path / "marks.kml")
    marks.write_text(marks.read_text().replace(",7</", ",7\n 13,n/a</", 1))
    assert read(name, marks) == (2, f"error: {marks}, line 2: a coordinate is 'n/a', not a number\n")
    zipped = tmp_path / "marks.kmz"
    with zipfile.ZipFile(zipped, "w") as archive:
        archive.write(marks, "doc.kml")
    assert read(name, zipped) == (2, f"error: {zipped}, doc.kml, line 2: a coordinate is 'n/a', not a number\n")
    with zipfile.ZipFile(zipped, "w") as archive:
        archive.write(kml(marks), "doc.kml")
    assert "50 points would be loaded" in read(name, zipped)[1]


def test_a_shapefile_without_its_parts(tmp_path, name):
    file = write(tmp_path / "places.shp", shapely.points(PLACES), id=NAMES)
    file.with_suffix(".prj").unlink()
    assert "names no coordinate reference system" in read(name, file)[1]
    file.with_suffix(".shx").unlink()
    assert "the .shx file beside it is missing" in read(name, file)[1]
    assert sorted(each.suffix for each in tmp_path.iterdir()) == [".cpg", ".dbf", ".shp"]  # none was written


def test_a_sheet_of_excel(tmp_path, name):
    rows = [["id", "lon", "lat"], ["a", 13.25, 52.5], ["b", "none", 52.5], ["c", 13.5, 52]]
    sheet = xlsx(tmp_path / "fleet.xlsx", rows)
    code, said = read(name, sheet, "--key", "id")
    assert (code, "2 points would be loaded, x from 13.25 to 13.5" in said) == (0, True), said
    assert "  row 3: lon is 'none', not a number\n" in said
    assert "name two with --x and --y; it has id, a, b" in read(name, xlsx(sheet, [["id", "a", "b"], [1, 2, 3]]))[1]


def test_without_the_extra_the_error_says_what_to_install(tmp_path, name, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyogrio", None)
    monkeypatch.delitem(sys.modules, "dynhull_cli.load.read_layer", raising=False)
    file = tmp_path / "a.gpkg"
    file.write_bytes(b"SQLite format 3\0")
    words = "error: dynhull load needs pyogrio, which is not installed. "
    assert read(name, file) == (2, words + "Install it with: pip install 'dynhull[client,cli,files,gis]'\n")


def test_options_of_layers(tmp_path, name):
    assert dynhull("load", name, "--format", "gpkg", input=b"SQLite format 3\0").stderr == (
        "error: standard input is a pipe, and gpkg is read by GDAL: write it to a file first\n"
    )
    (tmp_path / "a.csv").write_text("x,y\n1,2\n")
    assert (
        "--layer is for gpkg, shp, fgb, gpx, kml, xlsx, not for csv"
        in read(name, tmp_path / "a.csv", "--layer", "a")[1]
    )
