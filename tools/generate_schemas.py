"""Make `replay/schemas/` from `schemas/*.proto`.

Run from the root of the checkout: `python tools/generate_schemas.py`. With
`--check` nothing is written and the exit code is 1 where the generated files
are not those that the .proto files call for.

Besides protoc's own modules it writes `catalog.py`: the bracketed note beside
every field (unit, frame), so that axis labels and reports are taken from the
one place where a field is defined.
"""

import argparse
import filecmp
import re
import sys
import tempfile
from pathlib import Path

import google.protobuf
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from grpc_tools import protoc

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "schemas"
TARGET = ROOT / "replay" / "schemas"
VIRTUAL = "replay/schemas"
NOTE = re.compile(r"\[(?P<note>[^\]]+)\]\s*$")
HEADER = "# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.\n"


def generate(target: Path) -> None:
    """Write every generated module below `target` (which stands for `replay/schemas`)."""
    well_known = Path(protoc.__file__).parent / "_proto"
    files = sorted(path.name for path in SOURCE.glob("*.proto"))
    with tempfile.TemporaryDirectory() as scratch:
        descriptors = Path(scratch) / "descriptors.binpb"
        code = protoc.main(
            [
                "protoc",
                f"-I{VIRTUAL}={SOURCE}",
                f"-I{well_known}",
                f"--python_out={scratch}",
                f"--pyi_out={scratch}",
                f"--descriptor_set_out={descriptors}",
                "--include_source_info",
                *[f"{VIRTUAL}/{name}" for name in files],
            ]
        )
        if code != 0:
            raise SystemExit(code)
        target.mkdir(parents=True, exist_ok=True)
        for path in sorted((Path(scratch) / VIRTUAL).glob("*_pb2.py*")):
            (target / path.name).write_text(HEADER + path.read_text())
        (target / "catalog.py").write_text(_catalog(descriptors.read_bytes()))


def _catalog(serialized: bytes) -> str:
    descriptors = FileDescriptorSet.FromString(serialized)
    lines = [
        HEADER,
        '"""Unit and frame of every field, as `message.field` to the note in its .proto file."""',
        "",
        "from typing import Final",
        "",
        "FIELD_NOTES: Final[dict[str, str]] = {",
    ]
    missing = []
    for file in descriptors.file:
        notes = {
            tuple(location.path): location.trailing_comments.strip().replace("\n", " ")
            for location in file.source_code_info.location
        }
        for message_index, message in enumerate(file.message_type):
            for field_index, field in enumerate(message.field):
                match = NOTE.search(notes.get((4, message_index, 2, field_index), ""))
                name = f"{file.package}.{message.name}.{field.name}"
                if match:
                    lines.append(f"    {name!r}: {match['note']!r},")
                elif field.type != FieldDescriptorProto.TYPE_MESSAGE:
                    missing.append(name)
    if missing:
        raise SystemExit("no [unit; frame] beside: " + ", ".join(missing))
    return "\n".join([*lines, "}", ""])


def _difference(made: Path) -> list[str]:
    names = sorted({path.name for path in made.iterdir()})
    kept = {path.name for path in TARGET.glob("*_pb2.py*")} | {"catalog.py"}
    stale = sorted(kept - set(names))
    _, mismatch, errors = filecmp.cmpfiles(made, TARGET, names, shallow=False)
    return sorted({*mismatch, *errors, *stale})


def main() -> int:
    """Generate, or check that what is generated is current."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    if not arguments.check:
        generate(TARGET)
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        generate(Path(scratch))
        different = _difference(Path(scratch))
    if different:
        print(f"not current ({google.protobuf.__version__=}): {', '.join(different)}")
        print("run: python tools/generate_schemas.py")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
