"""Programs and commands of the pages, pasted as the copy button of the built page gives them, on one server.

Programs with a title are saved in files, and have tests of their own, as have the pages that need more.
"""

import re
import shlex
import subprocess
import sys
from code import InteractiveConsole
from collections import Counter
from pathlib import Path

import pytest
from blocks import Block, blocks
from command_line import dynhull
from server_process import server_process

DEFAULT_ADDRESS = "127.0.0.1:50051"
LANGUAGES = {"how-to/go", "how-to/java", "how-to/rust"}
ELSEWHERE = {"tutorial", "how-to/brokers", "how-to/serve"} | LANGUAGES  # their commands have tests of their own
PIECES = "reference/sdk"  # of programs: they begin with a client that is there

ENDING = (
    "create|put|insert|remove|delete|load|verify|query|replay|track|measure|separate|phases|frontier|"
    "fences (create|show|inside|between)"
)
COMMAND = re.compile(rf"(?P<given>(printf|echo) [^|]*\| )?dynhull (?P<arguments>({ENDING}) [^|]*)")
FILE = re.compile(r"printf .* > \S+|gzip .*")
CREATED = re.compile(r"""(?:create_hull\(|dynhull create |--hull |/hulls -H .*"name": )"?([\w/-]+)""")


class Prompt(InteractiveConsole):
    """The prompt of Python, which keeps the errors."""

    def __init__(self) -> None:
        super().__init__({"__name__": "__main__"})
        self._errors: list[str] = []

    def paste(self, program: str) -> list[str]:
        """The errors of a program, as they are written in tracebacks."""
        self._errors = []
        for line in [*program.splitlines(), ""]:
            self.push(line)
        return self._errors

    def showtraceback(self) -> None:
        self._errors.append("{0.__class__.__name__}: {0}".format(sys.exc_info()[1]))

    def showsyntaxerror(self, *_: object, **__: object) -> None:
        self.showtraceback()


def run(line: str) -> str | None:
    """The error of a command, of one that ends by itself and needs nothing but a server."""
    if FILE.fullmatch(line):
        subprocess.run(line, shell=True, check=True)
    elif command := COMMAND.fullmatch(line):
        given = command["given"] and subprocess.check_output(command["given"].rstrip("| "), shell=True)
        done = dynhull(*shlex.split(command["arguments"], comments=True), input=given)
        return f"{line}: {done.stderr}" if done.exit_code else None
    return None


def failures(name: str, pasted: list[Block], address: str) -> list[str]:
    """Errors of a page's programs and commands, in their order, other than those that the page shows."""
    errors: list[str | None] = []
    prompt = Prompt()
    for block in pasted:
        if block.language in ("python", "pycon"):
            if name.startswith("reference/"):  # each is of another function
                prompt = Prompt()
            program = block.text.replace(DEFAULT_ADDRESS, address)
            errors += [each for each in prompt.paste(program) if each not in block.shown]
        elif name not in ELSEWHERE:
            errors += map(run, block.text.splitlines())
    return [each for each in errors if each]


@pytest.fixture
def pages(site: Path) -> dict[str, list[Block]]:
    """The blocks of all pages, but for those that are saved as files."""
    paths = {str(page.parent.relative_to(site)): page for page in site.rglob("index.html")}
    return {name: list(blocks(paths[name].read_text())) for name in sorted(paths) if not name.startswith(PIECES)}


def test_pages_run_one_after_the_other(
    pages: dict[str, list[Block]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with server_process("--data", str(tmp_path / "data")) as server:
        monkeypatch.setenv("DYNHULL_ADDRESS", server.address)
        failed = {
            name: failures(name, [each for each in pasted if not each.title], server.address)
            for name, pasted in pages.items()
        }
    assert {name: errors for name, errors in failed.items() if errors} == {}


def test_each_hull_is_of_one_page(pages: dict[str, list[Block]]) -> None:
    texts = ["\n".join(each.text for each in page) for name, page in pages.items() if "reference/" not in name]
    pages_of = Counter(hull for text in texts for hull in set(CREATED.findall(text)))
    assert len(pages_of) > 20
    assert {hull: count for hull, count in pages_of.items() if count > 1} == {}


def test_doctests_are_copied_without_prompts_and_answers(pages: dict[str, list[Block]]) -> None:
    copied = [block for page in pages.values() for block in page if ">>> " in block.shown]
    assert len(copied) > 80
    assert [block for block in copied if ">>> " in block.text] == []
