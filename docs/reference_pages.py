"""Makes the reference pages that are not docstrings, when mkdocs builds the site: commands and protocol."""

import os
import re
import tempfile
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import grpc_tools
import mkdocs_gen_files
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorSet
from grpc_tools import protoc

import dynhull_client
from dynhull_surface.reasons import REASONS, Code, Exit, exit_of, http_of, repeat_of

PROTO = Path(__file__).parent.parent / "proto"
LABELS = {
    "TYPE_" + name: name.lower() for name in ("BOOL", "BYTES", "DOUBLE", "INT32", "INT64", "STRING", "UINT32", "UINT64")
}

Comments = dict[tuple[int, ...], str]


def commands() -> Iterator[str]:
    os.environ.update(COLUMNS="110", TERM="dumb", NO_COLOR="1")
    from typer.testing import CliRunner

    from dynhull_cli.commands import app

    yield "# Commands\n"
    names = [""]
    for entry in sorted(entry_points(group="dynhull.commands")):
        names += named(entry.name, entry.load())
    for name in names:
        title = f"dynhull {name}".strip()
        help_text = CliRunner().invoke(app, [*name.split(), "--help"], prog_name="dynhull").output
        yield f"## {title}\n\n```text\n{help_text.strip()}\n```\n"


def named(name: str, command: Any) -> Iterator[str]:
    """The name of a command, then those of the commands of a group, and of the commands beside it."""
    yield name
    for parts in (getattr(command, "commands", {}), getattr(command, "beside", {})):
        for part, inner in parts.items():
            yield from named(f"{name} {part}", inner)


def errors() -> Iterator[str]:
    yield "# Errors\n"
    yield "A refused request has changed nothing, unless its reason says otherwise. Messages are for people and may"
    yield "change; reasons are for programs. Numbered batches are those of a producer, such as a writer of the SDK.\n"
    yield "| reason | what has happened | class of the SDK | gRPC | HTTP | exit code | may be sent again |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for name, reason in REASONS.items():
        code, error = reason.code.name, reason.error
        ends = exit_of(getattr(dynhull_client, error)).value
        cells = name, reason.meaning, f"`{error}`", code, http_of(name, code), ends, repeat_of(name, code).value
        yield f"| {' | '.join(map(str, cells))} |"
    yield "\n## Without a reason\n"
    yield "What gRPC itself and proxies answer. With all other codes the class is `DynhullError`.\n"
    yield "| gRPC | class of the SDK | HTTP | exit code | may be sent again |\n| --- | --- | --- | --- | --- |"
    for each in Code:
        if each.error != "DynhullError":
            ends = exit_of(getattr(dynhull_client, each.error)).value
            yield f"| {each.name} | `{each.error}` | {each.http} | {ends} | {each.repeat.value} |"
    yield "\n## Exit codes of commands\n\n| code | meaning |\n| --- | --- |"
    for exit_code in Exit:
        yield f"| {exit_code.value} | {exit_code.meaning} |"
    yield ""


def described() -> FileDescriptorSet:
    """The contract with its comments."""
    files = sorted(str(path.relative_to(PROTO)) for path in PROTO.glob("dynhull/v1/*.proto"))
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "contract.binpb"
        include = Path(grpc_tools.__file__).parent / "_proto"
        code = protoc.main(
            ["", f"-I{PROTO}", f"-I{include}", "--include_source_info", f"--descriptor_set_out={out}", *files]
        )
        if code:
            raise RuntimeError("protoc cannot read the contract")
        return FileDescriptorSet.FromString(out.read_bytes())


def protocol() -> Iterator[str]:
    yield "# Protocol\n"
    yield "Package `dynhull.v1`, from the `.proto` files. Fields without a label are single and optional.\n"
    files = described().file
    comments = {
        file.name: {tuple(at.path): at.leading_comments for at in file.source_code_info.location} for file in files
    }
    for file in files:
        for i, service in enumerate(file.service):
            yield f"## {service.name}\n\n{text(comments[file.name], 6, i)}\n"
            for j, method in enumerate(service.method):
                takes, gives = link(method.input_type), link(method.output_type)
                takes, gives = (
                    "stream of " * method.client_streaming + takes,
                    "stream of " * method.server_streaming + gives,
                )
                yield f"### {method.name}\n\n{takes} → {gives}\n\n{text(comments[file.name], 6, i, 2, j)}\n"
    yield "## Messages\n"
    for file in files:
        for i, message in enumerate(file.message_type):
            yield from described_message(message, comments[file.name], (4, i), "")
        for i, enum in enumerate(file.enum_type):
            yield f"### {enum.name}\n\n{text(comments[file.name], 5, i)}\n"
            yield "| value | number | meaning |\n| --- | --- | --- |"
            for j, value in enumerate(enum.value):
                yield f"| {value.name} | {value.number} | {cell(comments[file.name], 5, i, 2, j)} |"
            yield ""


def described_message(message: DescriptorProto, comments: Comments, path: tuple[int, ...], outer: str) -> Iterator[str]:
    name = f"{outer}{message.name}"
    yield f"### {name}\n\n{text(comments, *path)}\n"
    if message.field:
        yield "| field | number | type | meaning |\n| --- | --- | --- | --- |"
        for j, field in enumerate(message.field):
            yield f"| {field.name} | {field.number} | {kind(field)} | {cell(comments, *path, 2, j)} |"
        yield ""
    for j, nested in enumerate(message.nested_type):
        yield from described_message(nested, comments, (*path, 3, j), f"{name}.")


def kind(field: FieldDescriptorProto) -> str:
    scalar = FieldDescriptorProto.Type.Name(field.type)
    repeated = "repeated " * (field.label == FieldDescriptorProto.LABEL_REPEATED)
    return repeated + (LABELS.get(scalar) or link(field.type_name))


def link(type_name: str) -> str:
    name = type_name.removeprefix(".dynhull.v1.")
    if name == type_name:
        return name.lstrip(".")
    return f"[{name}](#{re.sub('[^a-z0-9_-]', '', name.lower())})"


def text(comments: Comments, *path: int) -> str:
    return comments.get(path, "").strip()


def cell(comments: Comments, *path: int) -> str:
    return " ".join(text(comments, *path).split()).replace("|", "\\|")


for page, lines in (("commands", commands()), ("protocol", protocol()), ("errors", errors())):
    with mkdocs_gen_files.open(f"reference/{page}.md", "w") as file:
        file.write("\n".join(lines))
