"""PLY ahead of the importer: the header's claims, and binary faces of different sizes, which it cannot read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from impostor.errors import ModelError
from impostor.importing.materials import warn
from impostor.importing.sources import ModelFiles

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_INDEX_NAMES = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    name: str
    dtype: np.dtype
    count_dtype: np.dtype | None

    @property
    def least_size(self) -> int:
        return (self.count_dtype or self.dtype).itemsize


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property]

    @property
    def least_size(self) -> int:
        """Bytes of a record whose lists are empty."""
        return sum(p.least_size for p in self.properties)

    @property
    def has_lists(self) -> bool:
        return any(p.count_dtype is not None for p in self.properties)


def readable_ply(files: ModelFiles) -> bytes:
    """The file's bytes as the importer can read them.

    Raises
    ------
    ModelError
        When the header is no PLY header, or claims more than the file holds.
    """
    end = files.data.find(b"end_header")
    if not files.data.startswith(b"ply") or end < 0:
        raise ModelError(files.path, "header: no 'ply' ... 'end_header'; expected a PLY header")
    start = files.data.find(b"\n", end) + 1 or len(files.data)
    lines = [line.split() for line in files.data[:end].decode("ascii", "replace").splitlines()]
    style = next((line[1] for line in lines if line[:1] == ["format"] and len(line) > 1), "")
    if style not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise ModelError(files.path, f"header: format '{style}'; expected ascii or binary")
    elements = _elements(files, lines, ">" if style == "binary_big_endian" else "<")
    _check_claims(files, elements, style == "ascii", len(files.data) - start)
    if style == "ascii" or list(elements)[:2] != ["vertex", "face"]:
        return files.data
    return _with_even_faces(files, elements, start)


def _elements(files: ModelFiles, lines: list[list[str]], order: str) -> dict[str, _Element]:
    elements: dict[str, _Element] = {}
    last = None
    for line in lines:
        if line[:1] == ["element"] and len(line) == 3 and line[2].isdigit():
            last = elements[line[1]] = _Element(line[1], int(line[2]), [])
        elif line[:1] == ["property"] and last is not None and len(line) == (5 if line[1] == "list" else 3):
            types = [np.dtype(order + _TYPES[word]) for word in line[1:-1] if word in _TYPES]
            if len(types) != len(line) - (3 if line[1] == "list" else 2):
                raise ModelError(files.path, f"header: '{' '.join(line)}'; expected types {', '.join(_TYPES)}")
            last.properties.append(_Property(line[-1], types[-1], types[0] if line[1] == "list" else None))
        elif line[:1] in (["element"], ["property"]):
            raise ModelError(files.path, f"header: '{' '.join(line)}'; expected an element with a count, or a property")
    for name in ("vertex", "face"):
        if name not in elements:
            raise ModelError(files.path, f"header: no element '{name}'; expected a mesh of vertices and faces")
    missing = sorted({"x", "y", "z"} - {p.name for p in elements["vertex"].properties})
    if missing:
        raise ModelError(files.path, f"header: vertices have no property '{missing[0]}'; expected x, y and z")
    if not elements["face"].has_lists:
        raise ModelError(files.path, "header: faces have no list; expected a list vertex_indices")
    return elements


def _check_claims(files: ModelFiles, elements: dict[str, _Element], is_ascii: bool, held: int) -> None:
    # A number of an ASCII file takes two bytes: a digit and what parts it from the next.
    least = sum(e.count * (2 * len(e.properties) if is_ascii else e.least_size) for e in elements.values())
    # The last number may end without a newline.
    if least > held + 1:
        claims = ", ".join(f"{element.count} {name}" for name, element in elements.items())
        raise ModelError(files.path, f"header: {claims} need {least} bytes at least, file holds {held}: truncated")


def _with_even_faces(files: ModelFiles, elements: dict[str, _Element], start: int) -> bytes:
    """The file with its faces cut into triangles, when they have different numbers of corners."""
    vertex, face = elements["vertex"], elements["face"]
    first = face.properties[0] if face.properties else None
    if vertex.has_lists or first is None or first.count_dtype is None or not face.count or not _is_index_list(first):
        return files.data
    begin = start + vertex.count * vertex.least_size
    corners = int(np.frombuffer(files.data, first.count_dtype, 1, begin)[0])
    tail = face.least_size - first.least_size
    size = first.least_size + corners * first.dtype.itemsize + tail
    others = sum(
        element.count * element.least_size for name, element in elements.items() if name not in ("vertex", "face")
    )
    if begin + face.count * size + others == len(files.data) or any(p.count_dtype for p in face.properties[1:]):
        return files.data
    starts, sizes = _face_places(files, face, first, begin, tail)
    triangles = [_fans(files.data, starts[sizes == n], int(n), first.dtype) for n in np.unique(sizes) if n >= 3]
    if tail:
        warn(files, "colours of faces of different sizes are not read")
    return _rewritten(files.data, begin, np.concatenate(triangles or [np.zeros((0, 3), "i4")]))


def _is_index_list(prop: _Property) -> bool:
    return prop.name in _INDEX_NAMES and prop.dtype.kind in "iu"


def _face_places(
    files: ModelFiles, face: _Element, first: _Property, begin: int, tail: int
) -> tuple[np.ndarray, np.ndarray]:
    """Where each face's indices start, in bytes, and how many there are."""
    assert first.count_dtype is not None
    data, width, step = files.data, first.least_size, first.dtype.itemsize
    byte_order = "big" if first.count_dtype.byteorder == ">" else "little"
    starts, sizes = np.empty(face.count, np.int64), np.empty(face.count, np.int64)
    offset = begin
    for index in range(face.count):
        corners = int.from_bytes(data[offset : offset + width], byte_order)
        starts[index], sizes[index] = offset + width, corners
        offset += width + corners * step + tail
        if offset > len(data):
            raise ModelError(
                files.path, f"face {index} of {face.count} ends at byte {offset} of {len(data)}: truncated"
            )
    return starts, sizes


def _fans(data: bytes, starts: np.ndarray, corners: int, dtype: np.dtype) -> np.ndarray:
    """Triangles of all faces of one size, (M, 3) int32."""
    raw = np.frombuffer(data, np.uint8)[starts[:, None] + np.arange(corners * dtype.itemsize)]
    polygons = raw.view(dtype).astype("<i8")
    fans = [polygons[:, [0, k, k + 1]] for k in range(1, corners - 1)]
    return np.concatenate(fans).clip(-1, 2**31 - 1).astype("i4")


def _rewritten(data: bytes, begin: int, triangles: np.ndarray) -> bytes:
    end = data.find(b"end_header")
    start = data.find(b"\n", end) + 1
    head = data[:end][: data[:end].find(b"element face")]
    order = ">" if b"binary_big_endian" in head else "<"
    records = np.zeros(len(triangles), [("count", "u1"), ("corners", order + "i4", 3)])
    records["count"], records["corners"] = 3, triangles
    faces = f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    return head + faces.encode() + data[start:begin] + records.tobytes()
