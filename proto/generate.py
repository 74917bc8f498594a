"""Generate dynhull_proto and descriptors from the .proto files: `generate.py`, or `generate.py --check`.

The counts of batches are described in dynhull_surface, and come from there into the .proto files first.
"""

import argparse
import re
import sys
import tempfile
from importlib import resources
from pathlib import Path

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from grpc_tools import protoc

from dynhull_surface.counts import COUNTS

PROTO = Path(__file__).parent
CONTRACT = PROTO / "dynhull"
PACKAGE = PROTO / "dynhull_proto"
# For clients that make their messages of descriptors.
DESCRIPTORS = PROTO.parent / "clients" / "typescript" / "src" / "grpc" / "contract.binpb"
# Of a message, between a line that ends so and the other.
FIELDS = re.compile(r"(`make proto`.*\n\n)(?:.*\n)*?(  // End of counts)")
COUNT_FIELDS = {
    CONTRACT / "v1" / "batch.proto": "\n".join(
        f"  // {each.meaning[0].upper()}{each.meaning[1:]}.\n  uint64 {name} = {each.number};\n"
        for name, each in COUNTS.items()
    ),
    CONTRACT / "v1" / "hull_service.proto": "".join(
        f"  uint64 {name} = {each.sum_number};\n" for name, each in COUNTS.items()
    ),
}


def generate(out: Path) -> None:
    """Write the generated modules to `out`/dynhull_proto.

    The contract's own paths begin with dynhull/, which is the geometry library's name in Python. So protoc is shown a
    copy of it under dynhull_proto/.
    """
    with tempfile.TemporaryDirectory() as folder:
        include = Path(folder)
        sources = []
        for proto in sorted(CONTRACT.rglob("*.proto")):
            source = include / PACKAGE.name / proto.relative_to(CONTRACT)
            source.parent.mkdir(parents=True, exist_ok=True)
            source.write_text(proto.read_text().replace('import "dynhull/', f'import "{PACKAGE.name}/'))
            sources.append(str(source))
        arguments = [f"--{kind}_out={out}" for kind in ("python", "pyi")]
        arguments.append(f"--mypy_grpc_out=quiet:{out}")
        # Found beside the interpreter, so that an environment need not be activated.
        arguments.append(f"--plugin={Path(sys.executable).with_name('protoc-gen-mypy_grpc')}")
        well_known = resources.files("grpc_tools") / "_proto"
        if protoc.main(["protoc", f"-I{include}", f"-I{well_known}", *arguments, *sources]) != 0:
            raise SystemExit("protoc failed")
    for types in (out / PACKAGE.name).rglob("*_pb2_grpc.pyi"):
        (types.parent / "__init__.py").touch()
        if services := re.findall(r"^class (\w+)Stub:", types.read_text(), re.MULTILINE):
            types.with_suffix(".py").write_text(services_of(types.name.removesuffix("_grpc.pyi"), services))
        else:
            types.unlink()
    (out / PACKAGE.name / "__init__.py").touch()
    (out / PACKAGE.name / "py.typed").touch()


SERVICE = """

class {0}Stub(Stub):
    service = {1}.DESCRIPTOR.services_by_name["{0}"]


{0}Servicer = servicer_of({0}Stub.service, grpc)
add_{0}Servicer_to_server = adder_of({0}Stub.service, grpc)
"""


def services_of(module: str, services: list[str]) -> str:
    """The module with the classes of services."""
    imports = f"import grpc\n\nfrom dynhull_proto.v1 import {module}\n"
    surface = "from dynhull_surface.services import Stub, adder_of, servicer_of\n"
    return imports + surface + "".join(SERVICE.format(service, module) for service in services)


def described(folder: Path) -> bytes:
    """The contract as a FileDescriptorSet, with what it imports, and with the names of fields that JavaScript has."""
    out = folder / "contract.binpb"
    sources = map(str, sorted(CONTRACT.rglob("*.proto")))
    well_known = resources.files("grpc_tools") / "_proto"
    if protoc.main(
        ["protoc", f"-I{PROTO}", f"-I{well_known}", f"--descriptor_set_out={out}", "--include_imports", *sources]
    ):
        raise SystemExit("protoc failed")
    files = FileDescriptorSet.FromString(out.read_bytes())
    messages = [message for file in files.file for message in file.message_type]
    while messages:
        message = messages.pop()
        messages += message.nested_type
        for field in message.field:
            field.name = field.json_name  # readers of descriptors take the first
    return files.SerializeToString(deterministic=True)


def contents(package: Path) -> dict[str, str]:
    """Every generated file by its path within the package."""
    files = (path for path in package.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {str(path.relative_to(package)): path.read_text() for path in files}


def main() -> None:
    """Generate, or with --check fail where the committed package is not what would be generated."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="fail where dynhull_proto is stale, change nothing")
    check = parser.parse_args().check
    for proto, fields in COUNT_FIELDS.items():
        text = proto.read_text()
        filled = FIELDS.sub(rf"\g<1>{fields}\n\g<2>", text)
        if check and filled != text:
            sys.exit(f"stale, run `make proto`: {proto}")
        proto.write_text(filled)
    with tempfile.TemporaryDirectory() as folder:
        descriptors = described(Path(folder))
        if not check:
            DESCRIPTORS.write_bytes(descriptors)
            generate(PROTO)
            return
        generate(Path(folder))
        fresh, committed = contents(Path(folder) / PACKAGE.name), contents(PACKAGE)
    stale = sorted(path for path in fresh.keys() | committed.keys() if fresh.get(path) != committed.get(path))
    if descriptors != DESCRIPTORS.read_bytes():
        stale.append(str(DESCRIPTORS.relative_to(PROTO.parent)))
    if stale:
        sys.exit(f"stale, run `make proto`: {', '.join(stale)}")


if __name__ == "__main__":
    main()
