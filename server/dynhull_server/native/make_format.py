"""Write the format of events as a header of C++: python make_format.py FORMAT.py HEADER.hpp."""

import runpy
import sys
from collections.abc import Mapping
from pathlib import Path

TYPES = {"int64": "std::int64_t", "uint8": "std::uint8_t", "float64": "double"}


def constants(values: Mapping[str, object]) -> list[str]:
    """The integers among some values, as constants."""
    return [f"constexpr auto {name} = {value};" for name, value in values.items() if isinstance(value, int)]


def main(source: str, header: str) -> None:
    """Write the header."""
    found = {name: value for name, value in runpy.run_path(source).items() if not name.startswith("__")}
    lines = ["#pragma once", "#include <cstdint>", "namespace dynhull_server {", *constants(found)]
    for name, value in found.items():
        if isinstance(value, type):
            lines += [f"namespace {name} {{", *constants(vars(value)), "}"]
        elif isinstance(value, list):
            fields = [f"{TYPES[kind]} {field};" for field, kind in value]
            lines += ["#pragma pack(push, 1)", f"struct {name} {{", *fields, "};", "#pragma pack(pop)"]
    Path(header).write_text("\n".join([*lines, "}", ""]))


main(*sys.argv[1:])
