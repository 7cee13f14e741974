"""What a model file must hold to before an importer sees it: sizes that its header claims, counts, units, axes.

Importers believe headers, skip what they do not know and unroll every instance; these checks are what keeps a lying
or unusual file from a hang, a memory blow-up or a picture with parts missing.
"""

from __future__ import annotations

import io
import re
import struct
import zipfile
import zlib
from collections import Counter
from dataclasses import dataclass
from math import radians

import numpy as np
from lxml import etree  # type: ignore[attr-defined]

from impostor.errors import ModelError
from impostor.importing.materials import warn
from impostor.importing.parts import MOST_TRIANGLES
from impostor.importing.ply import readable_ply
from impostor.importing.sources import ModelFiles, utf8

_MOST_INSTANCES = 1_000_000
_MOST_UNZIPPED = 2 << 30
_CREASE, _SCAN_CREASE = radians(40), radians(80)
# The importer knows a statement by the single space behind it.
_ODD_BLANKS = re.compile(
    rb"^(?:[ \t]+(vt|vn|v|f|usemtl|mtllib)[ \t]+|(vt|vn|v|f|usemtl|mtllib)[ ]*\t[ \t]*)", re.MULTILINE
)
_DAE_DRAWN = ("{*}triangles", "{*}polylist", "{*}polygons")
_METRES = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}


@dataclass(frozen=True)
class Prepared:
    """A checked file and what it says about itself.

    Attributes
    ----------
    data : bytes
        For the importer.
    metres : float
        Length of the file's unit; 1 where a format states none.
    up : str or None
        "x", "y" or "z" where the file states it.
    crease : float
        Radians; the angle at which normals that are missing break.
    triangles : int or None
        How many the importer must find.
    """

    data: bytes
    metres: float = 1.0
    up: str | None = None
    crease: float = _CREASE
    triangles: int | None = None


def prepared(files: ModelFiles) -> Prepared:
    """Check a file of a format that the mesh importer reads.

    Raises
    ------
    ModelError
        Naming what the file claims and what it holds.
    """
    return CHECKS[files.suffix](files)


def _ply(files: ModelFiles) -> Prepared:
    return Prepared(readable_ply(files), crease=_SCAN_CREASE)


def _stl(files: ModelFiles) -> Prepared:
    data = files.data
    if len(data) >= 84:
        count = struct.unpack_from("<I", data, 80)[0]
        size = 84 + 50 * count
        if size == len(data):
            return Prepared(data, triangles=count)
        if not data.lstrip()[:5].lower() == b"solid" or b"facet" not in data[:4096].lower():
            raise ModelError(files.path, f"header: {count} triangles are {size} bytes, file holds {len(data)}")
    lower = data.lower()
    if b"endsolid" not in lower:
        raise ModelError(files.path, "no 'endsolid'; expected a whole ASCII or binary STL")
    return Prepared(utf8(data), triangles=lower.count(b"endfacet"))


def _off(files: ModelFiles) -> Prepared:
    text = re.sub(rb"#[^\n]*", b"", utf8(files.data))
    match = re.match(rb"\s*((?:ST)?C?N?4?n?)OFF\b(.*)", text, re.DOTALL)
    if match is None or b"4" in match[1] or b"n" in match[1]:
        raise ModelError(files.path, f"begins with {files.data[:12]!r}; expected OFF")
    lines = [line for line in match[2].splitlines() if line.strip()]
    try:
        vertices, faces = (int(word) for word in lines[0].split()[:2])
    except (IndexError, ValueError) as error:
        raise ModelError(files.path, "no line of counts; expected 'vertices faces edges'") from error
    if vertices < 0 or faces < 0 or len(lines) - 1 < vertices + faces:
        held = f"file holds {len(lines) - 1} lines"
        raise ModelError(files.path, f"counts: {vertices} vertices and {faces} faces, {held}: truncated")
    if match[1]:
        warn(files, f"{match[1].decode()}OFF: colours, normals and texture coordinates are not read")
    header = b"OFF\n" + b"\n".join(lines)
    return Prepared(header)


def _obj(files: ModelFiles) -> Prepared:
    if b"\0" in files.data[:4096]:
        raise ModelError(files.path, "holds binary data; expected an OBJ text")
    data = utf8(files.data)
    if _ODD_BLANKS.search(data):
        data = _ODD_BLANKS.sub(rb"\1\2 ", data)
    if short := re.search(rb"^f[ \t]+\S+(?:[ \t]+\S+)?[ \t]*\r?$", data, re.MULTILINE):
        raise ModelError(files.path, f"line {_line(data, short)}: '{_text(short)}' has fewer than 3 corners")
    if zero := re.search(rb"^f[^\n#]*[ \t/]0+(?:[/ \t\r\n]|\Z)[^\n]*", data, re.MULTILINE):
        raise ModelError(files.path, f"line {_line(data, zero)}: '{_text(zero)}' has index 0; expected 1 and up")
    if re.search(rb"^[lp][ \t]", data, re.MULTILINE):
        warn(files, "points and lines, not drawn")
    if re.search(rb"^f[^\n#]*[ \t/]-\d", data, re.MULTILINE):
        data = _absolute_indices(data)
    return Prepared(data)


def _line(data: bytes, match: re.Match) -> int:
    return data.count(b"\n", 0, match.start()) + 1


def _text(match: re.Match) -> str:
    return match[0].decode("utf-8", "replace").strip()


def _absolute_indices(data: bytes) -> bytes:
    """OBJ text whose negative indices, which count back from where they stand, are replaced by positive ones."""
    counts = Counter()
    kinds = (b"v", b"vt", b"vn")
    lines = data.replace(b"\\\n", b"").splitlines()
    for number, line in enumerate(lines):
        key = line.split(None, 1)[0] if line.strip() else b""
        counts[key] += 1
        if key == b"f" and b"-" in line:
            corners = [
                b"/".join(
                    str(counts[kind] + 1 + int(index)).encode() if index.startswith(b"-") else index
                    for kind, index in zip(kinds, corner.split(b"/"), strict=False)
                )
                for corner in line.split()[1:]
            ]
            lines[number] = b"f " + b" ".join(corners)
    return b"\n".join(lines)


def obj_index_problem(data: bytes) -> str | None:
    """The first kind of index of an OBJ's faces that reaches past what the file holds, in words."""
    corners = re.findall(
        rb"[ \t](-?\d+)(?:/(-?\d*))?(?:/(-?\d*))?", b"\n".join(re.findall(rb"^f[^\n]*", data, re.MULTILINE))
    )
    for column, kind in enumerate((b"v", b"vt", b"vn")):
        held = len(re.findall(rb"^" + kind + rb"[ \t]", data, re.MULTILINE))
        indices = [int(corner[column]) for corner in corners if corner[column]]
        wrong = next((index for index in indices if not 1 <= index <= held), None)
        if wrong is not None:
            return f"a face uses {kind.decode()} {wrong}; expected 1..{held}"
    return None


def _three_mf(files: ModelFiles) -> Prepared:
    try:
        with zipfile.ZipFile(io.BytesIO(files.data)) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
            if size > _MOST_UNZIPPED:
                raise ModelError(files.path, f"unpacks to {size} bytes; expected at most {_MOST_UNZIPPED}")
            names = [name for name in archive.namelist() if "3d/3dmodel.model" in name.lower()]
            if not names:
                raise ModelError(files.path, "no 3D/3dmodel.model inside; expected a 3MF package")
            model = archive.read(names[0])
            other_models = [name for name in archive.namelist() if name.lower().endswith(".model") and name != names[0]]
            others = [archive.read(name) for name in other_models]
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError, ValueError) as error:
        raise ModelError(files.path, f"not a whole ZIP archive ({error}); expected a 3MF package") from error
    root = _xml(files, model)
    total = _check_3mf_instances(files, root, sum(other.count(b"triangle ") for other in others))
    if any(b"colorgroup" in part or b"basematerials" in part or b"texture2d" in part for part in (model, *others)):
        warn(files, "colours and textures of 3MF are not read, drawn grey")
    unit = root.get("unit", "millimeter")
    if unit not in _METRES:
        raise ModelError(files.path, f"unit '{unit}'; expected one of {', '.join(_METRES)}")
    return Prepared(files.data, _METRES[unit], "z", triangles=None if others else total)


def _check_3mf_instances(files: ModelFiles, root: etree._Element, elsewhere: int) -> int:
    own, children = {}, {}
    for element in root.iter("{*}object"):
        name = element.get("id", "")
        own[name] = sum(1 for _ in element.iter("{*}triangle"))
        children[name] = [component.get("objectid", "") for component in element.iter("{*}component")]
        if any(key.endswith("path") for component in element.iter("{*}component") for key in component.attrib):
            own[name] += elsewhere
    items = [item.get("objectid", "") for item in root.iter("{*}item")]
    for name in {*items, *(child for group in children.values() for child in group)} - set(own):
        if not elsewhere:
            raise ModelError(files.path, f"object '{name}' is used but not there; expected one of {len(own)} objects")
    return _check_instances(files, children, own, items)


def _check_instances(files: ModelFiles, children: dict, own: dict, roots: list) -> int:
    """Triangles with all instances; loops, and instances of instances beyond what can be drawn, are refused."""
    totals: dict = {}
    open_names: set = set()

    def total(name) -> tuple[int, int]:
        if name in open_names:
            raise ModelError(files.path, f"object '{name}' holds itself; expected no loops")
        if name not in totals:
            open_names.add(name)
            below = [total(child) for child in children.get(name, ())]
            open_names.discard(name)
            totals[name] = (1 + sum(b[0] for b in below), own.get(name, 0) + sum(b[1] for b in below))
        return totals[name]

    sums = [total(root) for root in roots]
    instances, triangles = sum(s[0] for s in sums), sum(s[1] for s in sums)
    if instances > _MOST_INSTANCES or triangles > MOST_TRIANGLES:
        most = f"expected at most {_MOST_INSTANCES} and {MOST_TRIANGLES}"
        raise ModelError(files.path, f"unrolls to {instances} instances and {triangles} triangles, {most}")
    return triangles


def _dae(files: ModelFiles) -> Prepared:
    root = _xml(files, files.data)
    if etree.QName(root).localname != "COLLADA":
        raise ModelError(files.path, f"root element is <{etree.QName(root).localname}>; expected <COLLADA>")
    if next(root.iter("{*}instance_controller"), None) is not None:
        raise ModelError(files.path, "holds skinned meshes (instance_controller); expected meshes without skins")
    if any(next(root.iter("{*}" + name), None) is not None for name in ("lines", "linestrips")):
        warn(files, "lines, not drawn")
    if root.find("{*}scene/{*}instance_visual_scene") is None:
        raise ModelError(files.path, "no <scene> with an <instance_visual_scene>; expected one")
    _check_dae_instances(files, root)
    unit, up = root.find("{*}asset/{*}unit"), root.findtext("{*}asset/{*}up_axis", "Y_UP").strip()
    if up not in ("X_UP", "Y_UP", "Z_UP"):
        raise ModelError(files.path, f"up_axis '{up}'; expected X_UP, Y_UP or Z_UP")
    return Prepared(files.data, _dae_metres(files, unit), up[0].lower())


def _check_dae_instances(files: ModelFiles, root: etree._Element) -> None:
    counts = {
        geometry.get("id"): sum(int(drawn.get("count", 0)) for drawn in geometry.iter(*_DAE_DRAWN))
        for geometry in root.iter("{*}geometry")
    }
    names = {node: node.get("id") or f"node {index}" for index, node in enumerate(root.iter("{*}node"))}
    children, own = {}, {}
    for node, name in names.items():
        children[name] = [names[child] for child in node.iterchildren("{*}node")]
        children[name] += [link.get("url", "")[1:] for link in node.iterchildren("{*}instance_node")]
        own[name] = sum(counts.get(link.get("url", "")[1:], 0) for link in node.iterchildren("{*}instance_geometry"))
    _check_instances(files, children, own, [names[n] for n in root.iterfind("{*}library_visual_scenes/*/{*}node")])


def _dae_metres(files: ModelFiles, unit: etree._Element | None) -> float:
    text = "1" if unit is None else unit.get("meter", "1")
    try:
        metres = float(text)
    except ValueError:
        metres = 0.0
    if not (np.isfinite(metres) and metres > 0):
        raise ModelError(files.path, f"unit meter='{text}'; expected a positive number")
    return metres


def _xml(files: ModelFiles, data: bytes) -> etree._Element:
    try:
        return etree.fromstring(data, etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True))
    except etree.XMLSyntaxError as error:
        raise ModelError(files.path, f"XML: {error}") from error


CHECKS = {".3mf": _three_mf, ".dae": _dae, ".obj": _obj, ".off": _off, ".ply": _ply, ".stl": _stl}
