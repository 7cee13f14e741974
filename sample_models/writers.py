"""Writers of GLB, OBJ, PLY and STL files: the same input gives the same bytes."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from shapes import Mesh

LICENCE = "CC0 1.0 (public domain)"


def encoded(image: np.ndarray, jpeg_quality: int | None = None) -> bytes:
    """An (H, W, 3 or 4) uint8 image as PNG, or as JPEG when a quality is given."""
    stream = io.BytesIO()
    if jpeg_quality is None:
        Image.fromarray(image).save(stream, "PNG", optimize=True)
    else:
        Image.fromarray(image).save(stream, "JPEG", quality=jpeg_quality, optimize=True)
    return stream.getvalue()


def linear(color: str) -> list[float]:
    """The linear RGB of an sRGB colour written as "#rrggbb"."""
    value = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.round(np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4), 5).tolist()


class Glb:
    """A binary glTF 2.0 file under construction. Every `add_*` returns the new index."""

    def __init__(self, name: str):
        self._buffer = bytearray()
        self._json: dict = {
            "asset": {"version": "2.0", "generator": "make_samples.py", "copyright": LICENCE},
            "scene": 0,
            "scenes": [{"name": name, "nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }

    def _append(self, key: str, entry: dict) -> int:
        self._json.setdefault(key, []).append(entry)
        return len(self._json[key]) - 1

    def _view(self, data: bytes, target: int | None = None) -> int:
        self._buffer.extend(b"\0" * (-len(self._buffer) % 4))
        view = {"buffer": 0, "byteOffset": len(self._buffer), "byteLength": len(data)}
        self._buffer.extend(data)
        return self._append("bufferViews", view | ({"target": target} if target else {}))

    def _accessor(self, array: np.ndarray, kind: str, target: int, bounds: bool = False) -> int:
        component = {"float32": 5126, "uint16": 5123, "uint32": 5125}[array.dtype.name]
        entry = {"bufferView": self._view(array.tobytes(), target), "componentType": component}
        entry |= {"count": array.size if kind == "SCALAR" else len(array), "type": kind}
        if bounds:
            entry |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        return self._append("accessors", entry)

    def add_texture(self, image: np.ndarray, jpeg_quality: int | None = None) -> int:
        """Embed an (H, W, 3 or 4) uint8 sRGB image."""
        kind = "image/png" if jpeg_quality is None else "image/jpeg"
        source = self._append("images", {"bufferView": self._view(encoded(image, jpeg_quality)), "mimeType": kind})
        if "samplers" not in self._json:
            self._append("samplers", {"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497})
        return self._append("textures", {"sampler": 0, "source": source})

    def add_material(
        self,
        name: str,
        color: str = "#ffffff",
        texture: int | None = None,
        roughness: float = 0.9,
        metallic: float = 0.0,
        alpha_cutoff: float | None = None,
    ) -> int:
        """A material; with an alpha cutoff it is masked and two-sided."""
        surface: dict = {"baseColorFactor": [*linear(color), 1.0]}
        if texture is not None:
            surface["baseColorTexture"] = {"index": texture}
        surface |= {"metallicFactor": metallic, "roughnessFactor": roughness}
        entry: dict = {"name": name, "pbrMetallicRoughness": surface}
        if alpha_cutoff is not None:
            entry |= {"alphaMode": "MASK", "alphaCutoff": alpha_cutoff, "doubleSided": True}
        return self._append("materials", entry)

    def add_mesh(self, name: str, parts: Sequence[tuple[Mesh, int]]) -> int:
        """A mesh of one primitive for each (shape, material)."""
        primitives = []
        for mesh, material in parts:
            textured = "baseColorTexture" in self._json["materials"][material]["pbrMetallicRoughness"]
            attributes = {
                "POSITION": self._accessor(mesh.positions.astype(np.float32), "VEC3", 34962, bounds=True),
                "NORMAL": self._accessor(mesh.normals.astype(np.float32), "VEC3", 34962),
            }
            if textured:
                attributes["TEXCOORD_0"] = self._accessor(mesh.uvs.astype(np.float32), "VEC2", 34962)
            faces = mesh.faces.astype(np.uint16 if len(mesh.positions) < 65535 else np.uint32)
            indices = self._accessor(faces, "SCALAR", 34963)
            primitives.append({"attributes": attributes, "indices": indices, "material": material})
        return self._append("meshes", {"name": name, "primitives": primitives})

    def add_node(
        self,
        name: str,
        mesh: int | None = None,
        parent: int | None = None,
        at: Sequence[float] | None = None,
        turn: tuple[str, float] | None = None,
        scale: Sequence[float] | None = None,
    ) -> int:
        """A node: translation in metres, a turn in degrees about one axis, a scale; under a parent or the scene."""
        entry: dict = {"name": name}
        if mesh is not None:
            entry["mesh"] = mesh
        if at is not None:
            entry["translation"] = [float(value) for value in at]
        if turn is not None:
            half = np.radians(turn[1]) / 2
            quaternion = [0.0, 0.0, 0.0, float(np.cos(half))]
            quaternion["xyz".index(turn[0])] = float(np.sin(half))
            entry["rotation"] = quaternion
        if scale is not None:
            entry["scale"] = [float(value) for value in scale]
        node = self._append("nodes", entry)
        siblings = self._json["scenes"][0]["nodes"]
        if parent is not None:
            siblings = self._json["nodes"][parent].setdefault("children", [])
        siblings.append(node)
        return node

    def save(self, path: Path) -> None:
        """Write the file."""
        self._buffer.extend(b"\0" * (-len(self._buffer) % 4))
        text = json.dumps(self._json | {"buffers": [{"byteLength": len(self._buffer)}]}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        with path.open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(self._buffer)))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text)
            file.write(struct.pack("<I4s", len(self._buffer), b"BIN\0") + self._buffer)


def write_ply(path: Path, mesh: Mesh, colors: np.ndarray) -> None:
    """A binary little-endian PLY with normals and (N, 3) uint8 sRGB vertex colours."""
    vertex = np.dtype([("position", "<f4", 3), ("normal", "<f4", 3), ("color", "u1", 3)])
    face = np.dtype([("count", "u1"), ("index", "<i4", 3)])
    vertices, faces = np.zeros(len(mesh.positions), vertex), np.zeros(len(mesh.faces), face)
    vertices["position"], vertices["normal"], vertices["color"] = mesh.positions, mesh.normals, colors
    faces["count"], faces["index"] = 3, mesh.faces
    lines = ["ply", "format binary_little_endian 1.0", f"comment {LICENCE}", f"element vertex {len(vertices)}"]
    lines += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    lines += [f"property uchar {name}" for name in ("red", "green", "blue")]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    path.write_bytes("\n".join(lines).encode() + vertices.tobytes() + faces.tobytes())


def write_stl(path: Path, mesh: Mesh) -> None:
    """A binary STL: facets only, no materials."""
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.zeros(len(mesh.faces), facet)
    corners = mesh.positions[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facets["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    facets["corners"] = corners
    path.write_bytes(LICENCE.encode().ljust(80) + struct.pack("<I", len(facets)) + facets.tobytes())


def write_obj(path: Path, parts: Sequence[tuple[str, Mesh]], materials: str, texture: np.ndarray) -> None:
    """An OBJ with its MTL and PNG beside it.

    Parameters
    ----------
    path : Path
        The three files differ in their suffix only.
    parts : sequence of (str, Mesh)
        Material name and shape.
    materials : str
        The text of the MTL file.
    texture : ndarray, (H, W, 4) uint8
    """
    lines = [f"# {LICENCE}", f"mtllib {path.stem}.mtl"]
    start = 1
    for name, mesh in parts:
        lines += [f"o {name}", f"usemtl {name}"]
        lines += ["v {:.3f} {:.3f} {:.3f}".format(*row) for row in mesh.positions]
        lines += [f"vt {u:.4f} {1.0 - v:.4f}" for u, v in mesh.uvs]
        lines += ["vn {:.3f} {:.3f} {:.3f}".format(*row) for row in mesh.normals]
        lines += [f"f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}" for a, b, c in mesh.faces + start]
        start += len(mesh.positions)
    path.write_text("\n".join(lines) + "\n", newline="\n")
    path.with_suffix(".mtl").write_text(materials, newline="\n")
    path.with_suffix(".png").write_bytes(encoded(texture))
