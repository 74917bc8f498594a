"""A CSV file of one's own as the demo's input."""

from pathlib import Path

import pytest

from dynhull_cli.demo.table import Table


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "points.csv"
    path.write_text(text, encoding="utf-8")
    return path


def table(path, x=None, y=None, identity=None, time=None, batches=100):
    return Table(path, x, y, identity, time, batches)


FLEET = """\
minute,truck,lon,lat
10,a,0,0
2,a,5,5
2,b,1,1
10,b,7,7
10,c,7,7
"""


def test_moves_by_id_in_the_order_of_time(tmp_path):
    scene = table(write(tmp_path, FLEET), identity="truck", time="minute")
    frames = list(scene.frames())
    assert scene.length == len(frames) == 2
    assert [frame.clock for frame in frames] == ["2", "10"]
    assert (frames[0].keys, frames[0].points.tolist()) == (["a", "b"], [[5, 5], [1, 1]])
    assert (frames[1].keys, frames[1].points.tolist()) == (["a", "b", "c"], [[0, 0], [7, 7], [7, 7]])
    assert frames[1].positions.tolist() == [[0, 0], [7, 7], [7, 7]]
    assert frames[1].names == ["a", "b", "c"]
    assert frames[1].names_at(frames[1].positions[1:2]) == ["b +1"]


def test_times_that_are_no_numbers_are_ordered_as_text(tmp_path):
    text = "when,x,y\n2024-05-02,1,1\n2024-05-01,2,2\n"
    assert [f.clock for f in table(write(tmp_path, text), time="when").frames()] == ["2024-05-01", "2024-05-02"]


def test_without_time_or_id_the_file_is_cut_in_parts(tmp_path):
    text = "X,Y\n" + "".join(f"{i},{i * i}\n" for i in range(10))
    frames = list(table(write(tmp_path, text), batches=4).frames())
    assert [len(frame.points) for frame in frames] == [3, 3, 3, 1]
    assert all(len(frame.keys) == 0 for frame in frames)
    assert len(frames[-1].positions) == 10


def test_bad_rows_are_counted_and_shown(tmp_path):
    text = "x,y\n1,2\nnan,1\n3\n4,five\n5,\n6,inf\n,7\n8,9\n"
    scene = table(write(tmp_path, text))
    assert scene.notes[0].endswith("2 points from columns x and y")
    assert scene.notes[1:] == [
        f"{tmp_path / 'points.csv'}: 6 bad rows left out:",
        "  line 3: x is 'nan', not finite",
        "  line 4: y is missing",
        "  line 5: y is 'five', not a number",
        "  line 6: y is missing",
        "  line 7: y is 'inf', not finite",
        "  ... and 1 more",
    ]


def test_rows_without_a_name_or_a_time_are_bad(tmp_path):
    scene = table(write(tmp_path, "id,t,x,y\na,1,1,2\n,2,3,4\nb,,5,6\n"), identity="id", time="t")
    assert scene.notes[2:] == ["  line 3: id is missing", "  line 4: t is missing"]


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("", {}, "is empty"),
        ("a,b\n1,2\n", {}, "name two with --x and --y; it has a, b"),
        ("a,b\n1,2\n", {"x": "a"}, "name its y column with --y; it has a, b"),
        ("a,b\n1,2\n", {"x": "a", "y": "c"}, r"has no column 'c' \(--y\); it has a, b"),
        ("x,y\n1,2\n", {"identity": "id"}, r"has no column 'id' \(--id\); it has x, y"),
        ("x,y\n1,2\n", {"time": "t"}, r"has no column 't' \(--time\)"),
        ("x,y\n", {}, "has no points"),
        ("x,y\none,2\n", {}, "(?s)has no points.*line 2: x is 'one', not a number"),
    ],
)
def test_unusable_files_say_what_to_do(tmp_path, text, options, message):
    with pytest.raises(ValueError, match=message):
        table(write(tmp_path, text), **options)
