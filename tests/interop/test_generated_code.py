"""The contract as other languages' generators read it."""

from importlib import import_module
from pathlib import Path

import pytest

from dynhull_proto import v1

FILES = [
    import_module(f"{v1.__name__}.{each.stem}").DESCRIPTOR
    for folder in v1.__path__
    for each in sorted(Path(folder).glob("*_pb2.py"))
]


@pytest.mark.parametrize("file", FILES, ids=[file.name for file in FILES])
def test_each_file_names_its_package_for_other_languages(file):
    # protoc-gen-go stops at a file without it; one package for all of them, as they are one in the contract.
    options = file.GetOptions()
    assert options.go_package == "dynhull/v1;dynhullv1"
    assert (options.java_package, options.csharp_namespace) == ("dynhull.v1", "Dynhull.V1")
