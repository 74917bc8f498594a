"""Exit codes follow the table of the client page, and messages name what is at fault."""

import re
from pathlib import Path

import pytest
from command_line import dynhull

SETTINGS = {
    "typo.toml": "max_point = 5\n",
    "word.toml": 'max_points = "many"\n',
}


@pytest.mark.usefixtures("served")
@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("config --port -1", "--port -1: "),
        ("config --port 70000", "--port 70000: "),
        (
            "config --config typo.toml",
            "typo.toml: max_point: there is no such setting; did you mean max_points?",
        ),
        ("config --config word.toml", "word.toml: max_points = 'many': "),
        ("config --in-memory --data x", "--in-memory stores nothing, so --data has no effect: leave one of them out"),
        ("config --in-memory --durability none", "--in-memory stores nothing, so --durability has no effect"),
        ("check nowhere", "nowhere is no data folder"),
        ("check points.csv", "points.csv is a file, not a data folder"),
        ("backup copy --data points.csv", "points.csv is a file, not a data folder"),
        ("backup copy --data nowhere", "nowhere is no data folder"),
        ("backup points.csv --data empty", "empty is no data folder"),
        ("restore nowhere", "nowhere"),
        ("export fleet fleet.txt", "the name must end in .csv"),
        ("token", "give --read or --write"),
        ("token --name trucks", "give --read or --write"),
        ("list a\\b", "prefix"),
        ("top --interval nan", "'--interval': 'nan'"),
        ("watch fleet --events 99999999999999999999", "'--events': '99999999999999999999'"),
        ("create fleet --max-points 99999999999999999999", "'--max-points': '99999999999999999999'"),
        ("create places, a*b", "name"),
    ],
)
def test_what_is_unusable_ends_with_2(tmp_path, monkeypatch, command, words):
    monkeypatch.chdir(tmp_path)
    for name, text in SETTINGS.items():
        Path(name).write_text(text)
    Path("points.csv").write_text("x,y\n1,2\n")
    Path("empty").mkdir()
    before = sorted(Path().iterdir())
    done = dynhull(*command.split())
    assert (done.exit_code, words in re.sub(r"[│\s]+", " ", done.stderr)) == (2, True), done.stderr
    assert (done.stdout, sorted(Path().iterdir())) == ("", before)


def test_a_setting_names_its_variable(monkeypatch):
    monkeypatch.setenv("DYNHULL_MAX_POINTS", "many")
    done = dynhull("config")
    assert done.exit_code == 2
    assert done.stderr.startswith("error: DYNHULL_MAX_POINTS='many': ")


def test_the_client_page_and_the_help_know_every_code():
    page = (Path(__file__).parents[2] / "docs" / "client.md").read_text()
    codes = re.findall(r"^\| (\d+) \|", page.partition("| exit code |")[2].partition("\n\n")[0], re.MULTILINE)
    assert codes == ["0", "1", "2", "3", "4", "70", "130"]
    helped = " ".join(dynhull("--help").stdout.split())
    assert all(re.search(rf"\b{code}\b", helped.partition("Exit codes:")[2]) for code in codes)
