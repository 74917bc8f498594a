"""One place has the past of one database: another one is refused at the start, and changes nothing there."""

import shutil

import pytest
from server_process import run, server_process, shape_options

from dynhull_client import HullClient
from dynhull_server.storage.segments.archive import Archive
from dynhull_server.storage.segments.owner import CLAIMS, Claimant, OccupiedError

QUIET = ("--snapshot-points", "50")


def refused(*options):
    """What a server says that does not start."""
    done = run("serve", "--port", "0", *shape_options(), *map(str, options))
    assert done.returncode == 2, done.stderr
    return done.stderr


def test_a_second_data_folder_is_refused_until_the_first_one_gives_way(tmp_path):
    first, past = tmp_path / "first", tmp_path / "past"
    for _ in range(2):
        with server_process("--data", str(first), "--history-dir", str(past), *QUIET):
            pass
    first = shutil.move(first, tmp_path / "moved")  # within its file system it stays the same
    with (
        server_process("--data", str(first), "--history-dir", str(past)) as server,
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet", keyed="str", history=True)
        client.put("fleet", ["a"], [(1, 2)])
    before = sorted(past.rglob("*"))
    (claim,) = (past / CLAIMS).iterdir()

    copy = shutil.copytree(first, tmp_path / "copy")
    for other in (copy, tmp_path / "new"):
        said = refused("--data", other, "--history-dir", past)
        assert f"{past} has the past of another database, the data folder {tmp_path / 'first'} of " in said
        assert f"{CLAIMS}/{claim.name}" in said
    assert sorted(past.rglob("*")) == before

    with server_process("--data", str(copy), "--history-dir", str(tmp_path / "own"), complaints=None):
        pass
    claim.unlink()
    with server_process("--data", str(copy), "--history-dir", str(past), complaints=None):
        pass
    assert "has the past of another database" in refused("--data", first, "--history-dir", past)


def test_of_two_that_claim_a_place_at_the_same_moment_none_goes_on_beside_the_other(tmp_path):
    class Late(Archive):
        """A place that another one claims between two looks."""

        def _claims(self):
            found = super()._claims()
            if not found:
                other = Archive(self.path)
                other.owner = Claimant("other", "the other one")
                other.claim()
            return found

    late = Late(tmp_path)
    late.owner = Claimant("late", "the late one")
    for _ in range(2):
        with pytest.raises(OccupiedError, match="the other one"):
            late.write("uid/name", b"content")
        with pytest.raises(OccupiedError, match="the other one"):
            late.remove("uid/name")
    assert [each.name for each in tmp_path.rglob("*") if each.is_file()] == ["other"]
