"""The scene of a glTF file as parts: nodes, meshes, skins and morph targets."""

from __future__ import annotations

from typing import Any

import numpy as np

from impostor.importing.gltf import Gltf, Primitive, Skin, floats
from impostor.importing.gltf_materials import GltfMaterials
from impostor.importing.materials import warn
from impostor.importing.parts import MOST_TRIANGLES, Part, normal_matrix
from impostor.importing.sources import ModelFiles
from impostor.srgb import srgb_from_linear

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_READ_EXTENSIONS = {
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_basisu",
    "KHR_texture_transform",
}
# These change neither shape nor base colour; of emission `GltfMaterials` tells.
_HARMLESS_EXTENSIONS = {
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_xmp_json_ld",
}
_SEE_THROUGH_EXTENSIONS = {
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_transmission",
    "KHR_materials_volume",
}
# A file that uses one of these has other geometry than a reader without it sees, required or not.
_GEOMETRY_EXTENSIONS = {"EXT_mesh_gpu_instancing", "EXT_meshopt_compression", "KHR_meshopt_compression"}


def read_gltf(files: ModelFiles, allow_missing_textures: bool) -> list[Part]:
    """Every triangle of the default scene, in rest pose.

    Raises
    ------
    ModelError
        Naming the place in the document that cannot be read as it asks to be.
    """
    return _SceneReader(Gltf(files), allow_missing_textures).parts()


class _SceneReader:
    def __init__(self, gltf: Gltf, allow_missing_textures: bool):
        self.gltf = gltf
        self.document = gltf.document
        self.materials = GltfMaterials(gltf, allow_missing_textures)
        self._check_extensions()
        self.worlds = self._world_from_nodes()

    def parts(self) -> list[Part]:
        """One part for each primitive that a node shows; one for each skinned node."""
        shown: dict[tuple[int, tuple[float, ...], int | None], list[np.ndarray]] = {}
        for index, world in self.worlds.items():
            node = self.document.nodes[index]
            if node.mesh is None:
                continue
            mesh = self.gltf.item("meshes", node.mesh, f"nodes[{index}]")
            weights = tuple(mesh.weights if node.weights is None else node.weights)
            key = (node.mesh, weights, node.skin)
            # A skin places its mesh by its joints alone.
            shown.setdefault(key, []).append(world if node.skin is None else np.eye(4))
        parts, other_modes, total = [], 0, 0
        for (mesh_index, weights, skin), worlds in shown.items():
            for index, primitive in enumerate(self.document.meshes[mesh_index].primitives):
                if primitive.mode not in (_TRIANGLES, _STRIP, _FAN):
                    other_modes += 1
                    continue
                place = f"meshes[{mesh_index}].primitives[{index}]"
                worlds_of_part = worlds if skin is None else worlds[:1]
                parts.append(self._part(place, primitive, weights, skin, worlds_of_part))
                total += len(parts[-1].triangles) * len(worlds_of_part)
                self._check_total(total)
        if other_modes:
            warn(self.gltf.files, f"{other_modes} primitives of points or lines, not drawn")
        self.materials.tell_what_is_not_drawn()
        if not shown:
            raise self.gltf.fail(
                f"the scene shows none of its {len(self.document.meshes)} meshes; expected at least one"
            )
        return parts

    def _check_total(self, total: int) -> None:
        if total > MOST_TRIANGLES:
            raise self.gltf.fail(f"{total} triangles and more with all instances; expected at most {MOST_TRIANGLES}")

    def _check_extensions(self) -> None:
        used = {*self.document.extensions_used, *self.document.extensions_required}
        for name in sorted(used & _GEOMETRY_EXTENSIONS):
            raise self.gltf.fail(f"extensionsUsed: {name} is not read; expected geometry without it")
        known = _READ_EXTENSIONS | _HARMLESS_EXTENSIONS | _SEE_THROUGH_EXTENSIONS
        for name in sorted(set(self.document.extensions_required) - known):
            raise self.gltf.fail(f"extensionsRequired: {name} is not known; expected a file that can do without it")
        for index, material in enumerate(self.document.materials):
            for name in sorted(_SEE_THROUGH_EXTENSIONS & set(material.extensions)):
                warn(self.gltf.files, f"materials[{index}] '{material.name}': {name} is not drawn, shown as opaque")

    def _world_from_nodes(self) -> dict[int, np.ndarray]:
        """`world_from_node` of every node of the scene, roots first."""
        nodes, roots = self.document.nodes, self._roots()
        worlds: dict[int, np.ndarray] = {}
        stack = [(root, np.eye(4), "scene") for root in reversed(roots)]
        while stack:
            index, parent, user = stack.pop()
            node = self.gltf.item("nodes", index, user)
            if index in worlds:
                raise self.gltf.fail(f"{user}: nodes[{index}] is in the scene twice; expected a tree without loops")
            worlds[index] = parent @ _local(node)
            stack.extend((child, worlds[index], f"nodes[{index}]") for child in reversed(nodes[index].children))
        return worlds

    def _roots(self) -> list[int]:
        if self.document.scenes:
            return self.gltf.item("scenes", self.document.scene or 0, "scene").nodes
        children = {child for node in self.document.nodes for child in node.children}
        roots = [index for index in range(len(self.document.nodes)) if index not in children]
        if self.document.nodes and not roots:
            raise self.gltf.fail("nodes: every node has a parent; expected a tree without loops")
        return roots

    def _part(
        self, place: str, primitive: Primitive, weights: tuple[float, ...], skin: int | None, worlds: list[np.ndarray]
    ) -> Part:
        draco = self.gltf.decoded_draco(primitive, place)

        def attribute(name: str) -> np.ndarray | None:
            if name in draco:
                return draco[name]
            index = primitive.attributes.get(name)
            return None if index is None else self.gltf.accessor(index, f"{place}.{name}")

        positions = attribute("POSITION")
        if positions is None:
            raise self.gltf.fail(f"{place}: has no POSITION; expected one")
        positions, normals = floats(positions), attribute("NORMAL")
        normals = None if normals is None else floats(normals)
        positions = self._morphed(positions, "POSITION", primitive, weights, place)
        if normals is not None:
            normals = self._morphed(normals, "NORMAL", primitive, weights, place)
        if skin is not None:
            positions, normals = self._skinned(positions, normals, attribute, skin, place)
        material, uvs, normal_uvs = self.materials.drawn(primitive, attribute, place)
        # In another pose than the file's own, tangents are worked out like those of a file that has none.
        own = material.normal_map is not None and normals is not None and skin is None and not any(weights)
        tangents = attribute("TANGENT") if own else None
        triangles = self._triangles(primitive, draco, len(positions), place)
        colors = attribute("COLOR_0")
        return Part(
            place,
            positions,
            triangles,
            normals,
            uvs,
            None if colors is None else _srgb_colors(colors, material.alpha_mode),
            None,
            material,
            worlds,
            normal_uvs,
            None if tangents is None else floats(tangents),
        )

    def _triangles(self, primitive: Primitive, draco: dict[str, np.ndarray], count: int, place: str) -> np.ndarray:
        if "indices" in draco:
            indices = draco["indices"].reshape(-1)
        elif primitive.indices is None:
            indices = np.arange(count)
        else:
            indices = self.gltf.accessor(primitive.indices, f"{place}.indices").reshape(-1)
        if indices.dtype.kind not in "iu":
            raise self.gltf.fail(f"{place}: indices are {indices.dtype}; expected unsigned integers")
        indices = indices.astype(np.int64)
        if primitive.mode == _TRIANGLES:
            if len(indices) % 3:
                raise self.gltf.fail(f"{place}: {len(indices)} indices; expected a multiple of 3")
            return indices.reshape(-1, 3)
        if len(indices) < 3:
            return np.zeros((0, 3), np.int64)
        if primitive.mode == _FAN:
            return np.column_stack([np.full(len(indices) - 2, indices[0]), indices[1:-1], indices[2:]])
        strip = np.column_stack([indices[:-2], indices[1:-1], indices[2:]])
        strip[1::2] = strip[1::2, [1, 0, 2]]
        return strip

    def _morphed(
        self, base: np.ndarray, name: str, primitive: Primitive, weights: tuple[float, ...], place: str
    ) -> np.ndarray:
        for weight, target in zip(weights, primitive.targets, strict=False):
            if weight and name in target:
                delta = floats(self.gltf.accessor(target[name], f"{place}.targets"))
                if delta.shape != base.shape:
                    raise self.gltf.fail(f"{place}: morph target has shape {delta.shape}; expected {base.shape}")
                base = base + np.float32(weight) * delta
        return base

    def _skinned(
        self, positions: np.ndarray, normals: np.ndarray | None, attribute: Any, skin_index: int, place: str
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Vertices where the joints of the rest pose hold them."""
        skin = self.gltf.item("skins", skin_index, place)
        matrices = self._joint_matrices(skin, f"skins[{skin_index}]")
        blended = np.zeros((len(positions), 3, 4))
        total = np.zeros(len(positions))
        for influence in range(8):
            joints, weights = attribute(f"JOINTS_{influence}"), attribute(f"WEIGHTS_{influence}")
            if joints is None or weights is None:
                break
            if joints.shape != (len(positions), 4) or weights.shape != joints.shape:
                raise self.gltf.fail(
                    f"{place}: JOINTS_{influence} and WEIGHTS_{influence} differ from POSITION in count"
                )
            if len(joints) and joints.max() >= len(matrices):
                raise self.gltf.fail(f"{place}: uses joint {joints.max()}; expected below {len(matrices)}")
            for column in range(4):
                weight = weights[:, column].astype(np.float64)
                blended += weight[:, None, None] * matrices[joints[:, column].astype(np.int64)]
                total += weight
        weightless = total <= 0
        if weightless.any():
            raise self.gltf.fail(f"{place}: vertex {np.argmax(weightless)} has no joint weight; expected a sum of 1")
        blended /= total[:, None, None]
        moved = np.einsum("nij,nj->ni", blended[..., :3], positions) + blended[..., 3]
        if normals is not None:
            normals = np.einsum("nij,nj->ni", normal_matrix(blended[..., :3]), normals)
        return moved, normals

    def _joint_matrices(self, skin: Skin, place: str) -> np.ndarray:
        """World from bind space for each joint, (J, 3, 4)."""
        missing = [joint for joint in skin.joints if joint not in self.worlds]
        if missing:
            raise self.gltf.fail(f"{place}: joint nodes[{missing[0]}] is not in the scene; expected every joint there")
        worlds = np.stack([self.worlds[joint] for joint in skin.joints]) if skin.joints else np.zeros((0, 4, 4))
        if skin.inverse_bind_matrices is None:
            return worlds[:, :3]
        inverse_bind = self.gltf.accessor(skin.inverse_bind_matrices, place)
        if inverse_bind.shape[0] < len(worlds) or inverse_bind.shape[1] != 16:
            raise self.gltf.fail(f"{place}: {len(inverse_bind)} inverse bind matrices; expected {len(worlds)}")
        inverse_bind = inverse_bind[: len(worlds)].reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)
        return (worlds @ inverse_bind)[:, :3]


def _local(node: Any) -> np.ndarray:
    """`parent_from_node`."""
    if node.matrix is not None:
        return np.array(node.matrix, np.float64).reshape(4, 4).T
    x, y, z, w = np.array(node.rotation) / (np.linalg.norm(node.rotation) or 1.0)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    local = np.eye(4)
    local[:3, :3] = rotation * np.array(node.scale)
    local[:3, 3] = node.translation
    return local


def _srgb_colors(colors: np.ndarray, alpha_mode: str) -> np.ndarray:
    """Linear COLOR_0 as sRGB bytes; its alpha counts only where the material is not OPAQUE."""
    if colors.dtype.kind == "u":
        colors = colors / np.iinfo(colors.dtype).max
    rgba = np.ones((len(colors), 4))
    rgba[:, : colors.shape[1]] = colors
    rgba[:, :3] = srgb_from_linear(rgba[:, :3])
    if alpha_mode == "OPAQUE":
        rgba[:, 3] = 1.0
    return np.rint(np.clip(rgba, 0.0, 1.0) * 255).astype(np.uint8)
