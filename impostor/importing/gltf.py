"""glTF 2.0 (.gltf and .glb): the scene in rest pose, as parts.

Read here and not through the mesh importer, which reads sparse and normalised accessors as other numbers, and leaves
out skins, second texture coordinates, alpha of vertex colours and what hangs below a camera.
"""

from __future__ import annotations

import struct
from typing import Annotated, Any

import DracoPy
import msgspec
import numpy as np

from impostor.errors import ModelError
from impostor.importing.sources import ModelFiles

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_MOST_ELEMENTS = 400_000_000
_JSON_CHUNK, _BIN_CHUNK = 0x4E4F534A, 0x004E4942

Index = Annotated[int, msgspec.Meta(ge=0)]
Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]


class _Object(msgspec.Struct, rename="camel"):
    name: str = ""
    extensions: dict[str, Any] = {}


class _Asset(msgspec.Struct, rename="camel"):
    version: str
    min_version: str = "2.0"


class _Header(msgspec.Struct):
    asset: _Asset


class _Buffer(_Object):
    byte_length: Index = 0
    uri: str | None = None


class _BufferView(_Object):
    buffer: Index = 0
    byte_offset: Index = 0
    byte_length: Index = 0
    byte_stride: Annotated[int, msgspec.Meta(ge=1, le=252)] | None = None


class _SparseIndices(msgspec.Struct, rename="camel"):
    buffer_view: Index
    component_type: int
    byte_offset: Index = 0


class _SparseValues(msgspec.Struct, rename="camel"):
    buffer_view: Index
    byte_offset: Index = 0


class _Sparse(msgspec.Struct, rename="camel"):
    count: Index
    indices: _SparseIndices
    values: _SparseValues


class _Accessor(_Object, kw_only=True):
    component_type: int
    count: Index
    type: str
    buffer_view: Index | None = None
    byte_offset: Index = 0
    normalized: bool = False
    sparse: _Sparse | None = None


class Primitive(_Object, kw_only=True):
    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: int = 4
    targets: list[dict[str, Index]] = []


class _Mesh(_Object, kw_only=True):
    primitives: list[Primitive]
    weights: list[float] = []


class Node(_Object):
    children: list[Index] = []
    mesh: Index | None = None
    skin: Index | None = None
    weights: list[float] | None = None
    matrix: Annotated[list[float], msgspec.Meta(min_length=16, max_length=16)] | None = None
    translation: Vec3 = (0.0, 0.0, 0.0)
    rotation: Vec4 = (0.0, 0.0, 0.0, 1.0)
    scale: Vec3 = (1.0, 1.0, 1.0)


class Skin(_Object, kw_only=True):
    joints: list[Index]
    inverse_bind_matrices: Index | None = None


class _Scene(_Object):
    nodes: list[Index] = []


class TextureInfo(_Object, kw_only=True):
    index: Index
    tex_coord: Index = 0


class NormalTextureInfo(TextureInfo, kw_only=True):
    scale: float = 1.0


class _Pbr(_Object):
    base_color_factor: Vec4 = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureInfo | None = None
    metallic_factor: float = 1.0
    roughness_factor: float = 1.0
    metallic_roughness_texture: Any = None


class GltfMaterial(_Object):
    pbr_metallic_roughness: _Pbr = msgspec.field(default_factory=_Pbr)
    emissive_factor: Vec3 = (0.0, 0.0, 0.0)
    normal_texture: NormalTextureInfo | None = None
    occlusion_texture: Any = None
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: float = 0.5
    double_sided: bool = False


class _Texture(_Object):
    source: Index | None = None
    sampler: Index | None = None


class _Image(_Object):
    uri: str | None = None
    mime_type: str | None = None
    buffer_view: Index | None = None


class _Sampler(_Object):
    wrap_s: int = 10497
    wrap_t: int = 10497


class Document(msgspec.Struct, rename="camel"):
    """The parts of a glTF file's JSON that a picture in rest pose needs."""

    asset: _Asset
    extensions_used: list[str] = []
    extensions_required: list[str] = []
    scene: Index | None = None
    scenes: list[_Scene] = []
    nodes: list[Node] = []
    meshes: list[_Mesh] = []
    skins: list[Skin] = []
    accessors: list[_Accessor] = []
    buffer_views: list[_BufferView] = []
    buffers: list[_Buffer] = []
    materials: list[GltfMaterial] = []
    textures: list[_Texture] = []
    images: list[_Image] = []
    samplers: list[_Sampler] = []


class Gltf:
    """An opened glTF file: its document and its accessors.

    Raises
    ------
    ModelError
        When the container, the JSON or the version is not glTF 2.
    """

    def __init__(self, files: ModelFiles):
        self.files = files
        self._binary: bytes | None = None
        json = self._json_chunk() if files.data.startswith(b"glTF") else files.data
        if files.suffix == ".glb" and json is files.data:
            raise ModelError(files.path, f"begins with {files.data[:4]!r}; expected b'glTF'")
        self._refuse_other_versions(self._decode(json, _Header).asset)
        self.document = self._decode(json, Document)
        self._buffers: dict[int, bytes] = {}

    def fail(self, problem: str) -> ModelError:
        return ModelError(self.files.path, problem)

    def item(self, kind: str, index: int, user: str) -> Any:
        """`kind[index]` of the document, or an error that names who asked for it."""
        items = getattr(self.document, kind)
        if index >= len(items):
            raise self.fail(f"{user}: refers to {kind}[{index}]; expected an index below {len(items)}")
        return items[index]

    def view(self, index: int, user: str) -> bytes:
        """The bytes of a buffer view."""
        view = self.item("buffer_views", index, user)
        data = self._buffer(view.buffer, f"bufferViews[{index}]")
        end = view.byte_offset + view.byte_length
        if end > len(data):
            raise self.fail(f"bufferViews[{index}]: ends at byte {end} of a buffer of {len(data)}")
        return data[view.byte_offset : end]

    def accessor(self, index: int, user: str) -> np.ndarray:
        """The elements of an accessor, (count, width); normalised integers as float32."""
        accessor = self.item("accessors", index, user)
        place = f"accessors[{index}]"
        if accessor.component_type not in _COMPONENTS or accessor.type not in _WIDTHS:
            raise self.fail(f"{place}: {accessor.component_type} {accessor.type}; expected a type of glTF 2.0")
        if accessor.count > _MOST_ELEMENTS:
            raise self.fail(f"{place}: {accessor.count} elements; expected at most {_MOST_ELEMENTS}")
        dtype, width = np.dtype(_COMPONENTS[accessor.component_type]), _WIDTHS[accessor.type]
        if accessor.buffer_view is None:
            values = np.zeros((accessor.count, width), dtype)
        else:
            stride = self.item("buffer_views", accessor.buffer_view, place).byte_stride
            data = self.view(accessor.buffer_view, place)
            values = self._elements(data, dtype, (accessor.count, width), accessor.byte_offset, stride, place)
        if accessor.sparse is not None:
            values = self._with_sparse(values, accessor.sparse, place)
        return _normalised(values) if accessor.normalized else values

    def decoded_draco(self, primitive: Primitive, place: str) -> dict[str, np.ndarray]:
        """Attributes (and `indices`) of a Draco-compressed primitive by name; empty when it is not compressed."""
        extension = primitive.extensions.get("KHR_draco_mesh_compression")
        if extension is None:
            return {}
        try:
            mesh = DracoPy.decode(self.view(extension["bufferView"], place))
            found = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
            arrays = {name: found[unique_id] for name, unique_id in extension["attributes"].items()}
            arrays["indices"] = mesh.faces.reshape(-1, 1)  # type: ignore[union-attr]
        except ModelError:
            raise
        except Exception as error:
            raise self.fail(f"{place}: Draco data cannot be decoded ({error!r})") from error
        for name, index in primitive.attributes.items():
            if name not in arrays:
                continue
            accessor = self.item("accessors", index, place)
            if len(arrays[name]) != accessor.count:
                raise self.fail(f"{place}.{name}: Draco data holds {len(arrays[name])}; expected {accessor.count}")
            if accessor.normalized:
                arrays[name] = _normalised(arrays[name])
        return arrays

    def image(self, index: int, user: str) -> tuple[bytes | str, str]:
        """The bytes of an embedded image, or the reference to one; and its place for messages."""
        image = self.item("images", index, user)
        place = f"images[{index}] ('{image.name or (image.uri or '')[:60]}')"
        if image.mime_type == "image/ktx2":
            raise self.fail(f"{place}: is a KTX2 texture; expected PNG, JPEG or WebP")
        if image.buffer_view is not None:
            return self.view(image.buffer_view, place), place
        if image.uri is None:
            raise self.fail(f"{place}: has neither uri nor bufferView")
        return image.uri, place

    def _json_chunk(self) -> bytes:
        """The JSON of a GLB; its BIN chunk is kept as buffer 0."""
        data = self.files.data
        if len(data) < 12:
            raise self.fail(f"{len(data)} bytes; expected a GLB header of 12")
        version, length = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise self.fail(f"glTF {version}.0 in a binary container; expected glTF 2.0")
        if length > len(data):
            raise self.fail(f"header says {length} bytes, file holds {len(data)}: truncated")
        chunks, offset = [], 12
        while offset + 8 <= length:
            size, kind = struct.unpack_from("<II", data, offset)
            if offset + 8 + size > length:
                raise self.fail(f"chunk {len(chunks)} says {size} bytes, {length - offset - 8} are left")
            chunks.append((kind, data[offset + 8 : offset + 8 + size]))
            offset += 8 + size
        if not chunks or chunks[0][0] != _JSON_CHUNK:
            raise self.fail("first chunk is not JSON; expected a JSON chunk")
        if len(chunks) > 1 and chunks[1][0] == _BIN_CHUNK:
            self._binary = chunks[1][1]
        return chunks[0][1]

    def _decode(self, json: bytes, schema: Any) -> Any:
        try:
            return msgspec.json.decode(json.removeprefix(b"\xef\xbb\xbf"), type=schema)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise self.fail(f"JSON: {error}") from error

    def _refuse_other_versions(self, asset: _Asset) -> None:
        if not asset.version.startswith("2."):
            raise self.fail(f"asset.version: glTF {asset.version}; expected glTF 2.0")
        if asset.min_version != "2.0":
            raise self.fail(f"asset.minVersion: needs glTF {asset.min_version}; expected glTF 2.0")

    def _buffer(self, index: int, user: str) -> bytes:
        buffer = self.item("buffers", index, user)
        if index not in self._buffers:
            if buffer.uri is not None:
                self._buffers[index] = self.files.read(buffer.uri, f"buffers[{index}]")
            elif index == 0 and self._binary is not None:
                self._buffers[index] = self._binary
            else:
                raise self.fail(f"buffers[{index}]: has no uri and no BIN chunk; expected one")
        data = self._buffers[index]
        if len(data) < buffer.byte_length:
            raise self.fail(f"buffers[{index}]: holds {len(data)} bytes; expected {buffer.byte_length}")
        return data

    def _elements(
        self, data: bytes, dtype: np.dtype, shape: tuple[int, int], offset: int, stride: int | None, place: str
    ) -> np.ndarray:
        size = dtype.itemsize * shape[1]
        stride = stride or size
        end = offset + (stride * (shape[0] - 1) + size if shape[0] else 0)
        if end > len(data) or stride < size:
            raise self.fail(f"{place}: {shape[0]} elements end at byte {end} of a buffer view of {len(data)}")
        return np.ndarray(shape, dtype, data, offset, (stride, dtype.itemsize))

    def _with_sparse(self, values: np.ndarray, sparse: _Sparse, place: str) -> np.ndarray:
        if sparse.indices.component_type not in (5121, 5123, 5125):
            raise self.fail(f"{place}: sparse indices of type {sparse.indices.component_type}; expected unsigned")
        dtype = np.dtype(_COMPONENTS[sparse.indices.component_type])
        data = self.view(sparse.indices.buffer_view, place)
        indices = self._elements(data, dtype, (sparse.count, 1), sparse.indices.byte_offset, None, place)[:, 0]
        data, shape = self.view(sparse.values.buffer_view, place), (sparse.count, values.shape[1])
        replacements = self._elements(data, values.dtype, shape, sparse.values.byte_offset, None, place)
        if sparse.count and indices.max() >= len(values):
            raise self.fail(f"{place}: sparse index {indices.max()}; expected below {len(values)}")
        values = values.copy()
        values[indices] = replacements
        return values


def floats(values: np.ndarray) -> np.ndarray:
    """Numbers of any kind as float32."""
    return np.ascontiguousarray(values, np.float32)


def _normalised(values: np.ndarray) -> np.ndarray:
    if values.dtype.kind not in "iu":
        return values
    return np.maximum(values.astype(np.float32) / np.iinfo(values.dtype).max, -1.0)
