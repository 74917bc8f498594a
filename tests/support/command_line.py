"""Commands of `dynhull` in this process: as users run them, without the half second that a process takes to start."""

from typer.testing import CliRunner, Result

from dynhull_cli.commands import app


def dynhull(*arguments: object, input: str | bytes | None = None) -> Result:  # noqa: A002
    """Run a command to its end."""
    return CliRunner().invoke(app, [str(each) for each in arguments], input=input)
