"""The archive of a `.fan` file: a ZIP whose every byte is accounted for before an image is touched."""

from __future__ import annotations

import os
import struct
import zipfile
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from os import PathLike
from typing import Any

from impostor.errors import FanFileError
from impostor.files.fan_manifest import MAX_MANIFEST_BYTES, Manifest, check_version, parse_manifest
from impostor.paths import check_path

FilePath = str | PathLike[str]
MAX_ENTRIES = 64


def write_archive(path: FilePath, entries: dict[str, bytes]) -> None:
    """Write these files as a ZIP, stored, in this order, with nothing in it that depends on time or machine."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, data in entries.items():
            info = zipfile.ZipInfo(name)  # dated 1980-01-01
            info.create_system, info.external_attr = 3, 0o100644 << 16  # the same bytes on every system
            archive.writestr(info, data)


@contextmanager
def open_archive(path: FilePath) -> Iterator[tuple[zipfile.ZipFile, Manifest]]:
    """The archive, found to hold what its manifest says and nothing else, and the manifest."""
    check_path(path)
    if not os.path.isfile(path):  # a pipe would wait for ever
        raise FanFileError(path, "no such file; expected a .fan")
    with ExitStack() as stack:
        file = stack.enter_context(_third_party(path, "cannot be read", open, path, "rb"))
        directory_offset = _directory_offset(file, path)
        archive = stack.enter_context(_third_party(path, "directory", zipfile.ZipFile, file))
        data = _manifest_entry(archive, path)
        check_version(data, path)
        manifest = parse_manifest(data, path)
        _check_entries(archive.infolist(), manifest, directory_offset, path)
        yield archive, manifest


def _directory_offset(file: Any, path: FilePath) -> int:
    """Where the ZIP's directory begins; the record that ends a ZIP must be the file's last 22 bytes."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(size - 22, 0))
    end = file.read(22)
    if len(end) < 22 or not end.startswith(b"PK\5\6"):
        raise FanFileError(path, f"{size} bytes that do not end as a ZIP does; truncated, extended or not a .fan")
    _, disk, directory_disk, here, entries, length, offset, comment = struct.unpack("<4s4H2LH", end)
    if (disk, directory_disk, here, comment) != (0, 0, entries, 0) or entries > MAX_ENTRIES:
        raise FanFileError(path, f"a ZIP with {entries} entries and {comment} bytes after it; expected a .fan")
    if offset + length + 22 != size:
        raise FanFileError(path, f"the ZIP's directory should end at byte {size - 22}, ends at {offset + length}")
    return offset


def _manifest_entry(archive: zipfile.ZipFile, path: FilePath) -> bytes:
    """The bytes of the first entry, the same in every version: a newer one is to be refused by its number."""
    entries = archive.infolist()
    if not entries or entries[0].filename != "manifest.json":
        raise FanFileError(path, "its first entry is not manifest.json; not a .fan")
    if entries[0].compress_type != zipfile.ZIP_STORED:
        raise FanFileError(path, "entry 'manifest.json' is compressed; expected it stored")
    return read_entry(archive, "manifest.json", MAX_MANIFEST_BYTES, path)


def _check_entries(entries: list[zipfile.ZipInfo], manifest: Manifest, directory_offset: int, path: FilePath) -> None:
    """Every entry expected, in its place, once, stored as it is, and not a byte between them."""
    names = Counter(entry.filename for entry in entries)
    expected = ["manifest.json", *(layer.file for layer in manifest.layers)]
    if list(names.elements()) != expected:
        missing, extra = sorted(Counter(expected) - names), sorted(names - Counter(expected))
        raise FanFileError(path, f"entries missing: {missing}; too many: {extra[:3]}; expected {', '.join(expected)}")
    offset = 0
    for entry in entries:
        as_it_is = entry.compress_type == zipfile.ZIP_STORED and entry.compress_size == entry.file_size
        if not as_it_is or entry.flag_bits or entry.extra or entry.comment:
            raise FanFileError(
                path, f"entry {entry.filename!r} is compressed, encrypted or annotated; expected it stored"
            )
        if entry.header_offset != offset:
            raise FanFileError(
                path, f"entry {entry.filename!r} begins at byte {entry.header_offset}; expected {offset}"
            )
        offset += 30 + len(entry.filename) + entry.file_size
    if offset != directory_offset:
        raise FanFileError(path, f"entries end at byte {offset}; the ZIP's directory begins at {directory_offset}")


def read_entry(archive: zipfile.ZipFile, name: str, most: int, path: FilePath) -> bytes:
    """One file of the archive, of at most so many bytes; its checksum is compared."""
    size = archive.getinfo(name).file_size
    if size > most:
        raise FanFileError(path, f"entry {name!r} has {size} bytes; expected at most {most}")
    return _third_party(path, f"entry {name!r}", archive.read, name)


def _third_party(path: FilePath, place: str, function: Any, *arguments: Any) -> Any:
    """Call what promises no closed list of exceptions for a damaged file."""
    try:
        return function(*arguments)
    except Exception as error:
        raise FanFileError(path, f"{place}: {error or type(error).__name__}; truncated or altered") from error
