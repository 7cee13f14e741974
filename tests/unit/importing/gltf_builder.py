"""Writes small glTF files for the tests."""

import io
import json
import struct

import numpy as np
from PIL import Image

_COMPONENTS = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i1": 5120, "i2": 5122}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "f4")
FACING = np.array([[0, 0, 1]] * 3, "f4")


class GltfBuilder:
    """A document whose arrays go into one binary chunk."""

    def __init__(self):
        self.binary = b""
        self.document = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
        self.document["nodes"] = [{"mesh": 0}]
        for key in ("accessors", "bufferViews", "materials", "textures", "images", "samplers", "meshes", "skins"):
            self.document[key] = []

    def view(self, data):
        offset = len(self.binary)
        self.binary += data + b"\0" * (-len(data) % 4)
        self.document["bufferViews"].append({"buffer": 0, "byteOffset": offset, "byteLength": len(data)})
        return len(self.document["bufferViews"]) - 1

    def accessor(self, array, **extra):
        array = np.ascontiguousarray(array)
        width = 1 if array.ndim == 1 else array.shape[1]
        accessor = {
            "bufferView": self.view(array.tobytes()),
            "componentType": _COMPONENTS[array.dtype.str[1:]],
            "count": len(array),
            "type": _TYPES[width],
            **extra,
        }
        self.document["accessors"].append(accessor)
        return len(self.document["accessors"]) - 1

    def mesh(self, positions=TRIANGLE, indices=(0, 1, 2), normals=FACING, mode=4, material=None, **arrays):
        """A mesh of one primitive; `arrays` are further attributes by name."""
        arrays = {"POSITION": positions, "NORMAL": normals, **arrays}
        attributes = {
            name: a if isinstance(a, int) else self.accessor(a) for name, a in arrays.items() if a is not None
        }
        primitive = {"attributes": attributes, "mode": mode}
        if indices is not None:
            primitive["indices"] = self.accessor(np.array(indices, "u2"))
        if material is not None:
            primitive["material"] = material
        self.document["meshes"].append({"primitives": [primitive]})
        return primitive

    def texture(self, pixels, kind="PNG", **info):
        """A base-colour texture of a new material; gives the material's number."""
        self.document["images"].append({"bufferView": self.view(encoded(pixels, kind))})
        self.document["textures"].append({"source": len(self.document["images"]) - 1})
        index = len(self.document["textures"]) - 1
        self.document["materials"].append({"pbrMetallicRoughness": {"baseColorTexture": {"index": index, **info}}})
        return len(self.document["materials"]) - 1

    def write(self, path):
        document = {key: value for key, value in self.document.items() if value != []}
        document["buffers"] = [{"byteLength": len(self.binary)}]
        path.write_bytes(glb(json.dumps(document).encode(), self.binary))
        return path


def glb(text, binary=b"", version=2):
    """A GLB container."""
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if binary:
        chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", version, 12 + len(chunks)) + chunks


def encoded(pixels, kind="PNG"):
    """An image file's bytes."""
    stream = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(stream, kind, **({"lossless": True} if kind == "WEBP" else {}))
    return stream.getvalue()
