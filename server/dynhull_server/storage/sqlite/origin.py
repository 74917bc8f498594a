"""Which file a database was when it was served last: the time at which that was made, noted beside it.

So a copy of a folder, which may lack what was committed since, differs from the folder itself, even if that was moved.
"""

from .folder import Folder

NOTE = "dynhull.origin"


def is_copied(folder: Folder) -> bool:
    """Whether the database is another file than the one that was noted; False where that cannot be known."""
    noted, birth = folder.disk.read(folder.path / NOTE), folder.disk.birth(folder.database)
    return noted is not None and birth is not None and noted != _line(birth)


def note(folder: Folder) -> None:
    """Note which file the database is, if that can be known."""
    file, birth = folder.path / NOTE, folder.disk.birth(folder.database)
    if birth is not None and folder.disk.read(file) != _line(birth):
        folder.disk.write(file, _line(birth))


def _line(birth: int) -> bytes:
    return b"%d\n" % birth
