"""Makes the pages of the protocol when mkdocs builds the site: one for each file of the contract."""

import re
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import grpc_tools
import mkdocs_gen_files
from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)
from grpc_tools import protoc

PROTO = Path(__file__).parent.parent / "proto"
LABELS = {
    "TYPE_" + name: name.lower() for name in ("BOOL", "BYTES", "DOUBLE", "INT32", "INT64", "STRING", "UINT32", "UINT64")
}
TITLES = {
    "hull_service": "Hulls: calls",
    "hull": "Hulls: messages",
    "feed": "Feeds: messages",
    "fence_service": "Fences: calls",
    "fence": "Fences: messages",
    "alarm_service": "Alarms: calls",
    "alarm": "Alarms: messages",
    "points": "Points",
    "batch": "Batches",
}

Comments = dict[tuple[int, ...], str]


def contract() -> FileDescriptorSet:
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


def index(files: Iterable[FileDescriptorProto]) -> Iterator[str]:
    yield "# Protocol\n"
    yield "Package `dynhull.v1`, from the `.proto` files. Fields without a label are single and optional.\n"
    yield "| page | file | calls | messages |\n| --- | --- | --- | --- |"
    for file in files:
        name = page_of(file)
        methods = [method.name for service in file.service for method in service.method]
        types = [each.name for each in [*file.message_type, *file.enum_type]]
        cells = [
            ", ".join(f"[{each}](protocol/{name}.md#{anchor(each)})" for each in part) for part in (methods, types)
        ]
        yield f"| [{TITLES[name]}](protocol/{name}.md) | `{file.name}` | {cells[0]} | {cells[1]} |"
    yield ""


def page(file: FileDescriptorProto) -> Iterator[str]:
    comments = {tuple(at.path): at.leading_comments for at in file.source_code_info.location}
    yield f"# {TITLES[page_of(file)]}\n\n`{file.name}`\n"
    for i, service in enumerate(file.service):
        yield f"## {service.name}\n\n{text(comments, 6, i)}\n"
        for j, method in enumerate(service.method):
            takes = "stream of " * method.client_streaming + link(method.input_type)
            gives = "stream of " * method.server_streaming + link(method.output_type)
            yield f"### {method.name}\n\n{takes} → {gives}\n\n{text(comments, 6, i, 2, j)}\n"
    yield "## Messages\n"
    for i, message in enumerate(file.message_type):
        yield from described_message(message, comments, (4, i), "")
    for i, enum in enumerate(file.enum_type):
        yield f"### {enum.name}\n\n{text(comments, 5, i)}\n"
        yield "| value | number | meaning |\n| --- | --- | --- |"
        for j, value in enumerate(enum.value):
            yield f"| {value.name} | {value.number} | {cell(comments, 5, i, 2, j)} |"
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
    return f"[{name}]({PAGES[name]}.md#{anchor(name)})"


def anchor(name: str) -> str:
    return re.sub("[^a-z0-9_-]", "", name.lower())


def page_of(file: FileDescriptorProto) -> str:
    return Path(file.name).stem


def types_of(file: FileDescriptorProto) -> Iterator[str]:
    """The names of the messages and enumerations of a file, with those within messages."""
    for message in file.message_type:
        yield from (message.name, *(f"{message.name}.{nested.name}" for nested in message.nested_type))
    yield from (enum.name for enum in file.enum_type)


def text(comments: Comments, *path: int) -> str:
    return comments.get(path, "").strip()


def cell(comments: Comments, *path: int) -> str:
    return " ".join(text(comments, *path).split()).replace("|", "\\|")


FILES = contract().file
PAGES = {name: page_of(file) for file in FILES for name in types_of(file)}

with mkdocs_gen_files.open("reference/protocol.md", "w") as out:
    out.write("\n".join(index(FILES)))
for each in FILES:
    with mkdocs_gen_files.open(f"reference/protocol/{page_of(each)}.md", "w") as out:
        out.write("\n".join(page(each)))
