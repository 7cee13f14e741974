"""Materials of a glTF file: base colour, alpha, normal map, textures with their samplers; and what is not drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from impostor.importing.gltf import Gltf, GltfMaterial, Primitive, TextureInfo, Vec2, floats
from impostor.importing.materials import (
    Material,
    NormalMap,
    decode_texture,
    finished,
    mirrored,
    read_normals,
    read_texture,
    warn,
)

_CLAMP, _MIRROR = 33071, 33648
_BEYOND = 1e-3  # of a picture: exporters miss its edge by less


class _Transform(msgspec.Struct, rename="camel"):
    offset: Vec2 = (0.0, 0.0)
    rotation: float = 0.0
    scale: Vec2 = (1.0, 1.0)
    tex_coord: int | None = None


class _SpecularGlossiness(msgspec.Struct, rename="camel"):
    diffuse_factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    diffuse_texture: TextureInfo | None = None


@dataclass(frozen=True)
class _Sampling:
    """How a texture is reached from the vertices."""

    uv_set: int
    transform: _Transform | None
    wraps: tuple[int, int]

    def laid(self, uvs: np.ndarray) -> tuple[_Layout, np.ndarray]:
        """What coordinates ask of the picture, and they themselves as the picture is then sampled.

        A sampler that mirrors is one that repeats a picture and its mirror image beside it; along an axis that the
        coordinates do not leave it is one that clamps, texel by texel.
        """
        mirrors, clamps = (np.array(self.wraps) == kind for kind in (_MIRROR, _CLAMP))
        if not (mirrors.any() and len(uvs)):
            return _Layout(False, False, (bool(clamps[0]), bool(clamps[1]))), uvs
        low, high = np.nanmin(uvs, axis=0), np.nanmax(uvs, axis=0)
        leaves = (low < -_BEYOND) | (high > 1 + _BEYOND)
        across, down = (bool(axis) for axis in leaves & mirrors)
        clamp_u, clamp_v = (bool(axis) for axis in ~leaves & mirrors | clamps)
        return _Layout(across, down, (clamp_u, clamp_v)), uvs * np.where([across, down], np.float32(0.5), np.float32(1))


@dataclass(frozen=True)
class _Layout:
    """A picture as its coordinates need it: with its mirror image right of it or below it, repeated or clamped."""

    across: bool
    down: bool
    clamp: tuple[bool, bool]


@dataclass(frozen=True, eq=False)
class _Surface:
    """A material, and how its texture and its normal map are reached where it has them."""

    material: Material
    color: _Sampling | None = None
    normals: _Sampling | None = None


class GltfMaterials:
    """The materials of one file, read when a primitive first uses them."""

    def __init__(self, gltf: Gltf, allow_missing_textures: bool):
        self._gltf, self._allow_missing_textures = gltf, allow_missing_textures
        self._surfaces: dict[int | None, _Surface] = {
            None: _Surface(Material(base_color=(1.0, 1.0, 1.0, 1.0), double_sided=False))
        }
        self._variants: dict[tuple[int, str, _Layout | None], Material] = {}
        self._not_drawn: dict[str, list[str]] = {}

    def drawn(
        self, primitive: Primitive, attribute: Callable[[str], np.ndarray | None], place: str
    ) -> tuple[Material, np.ndarray | None, np.ndarray | None]:
        """A primitive's material, and the coordinates at which its texture and its normal map are to be sampled.

        `attribute` gives the primitive's arrays by their names.
        """
        surface = self._surface(primitive.material)
        material, found = surface.material, []
        for kind, sampling in (("texture", surface.color), ("normal map", surface.normals)):
            layout = uvs = None
            if sampling is not None:
                uvs = self._coordinates(sampling, attribute, place, kind)
                if uvs is not None:
                    layout, uvs = sampling.laid(uvs)
                material = self._variant(material, kind, layout)
            found.append(uvs)
        return material, found[0], found[1]

    def tell_what_is_not_drawn(self) -> None:
        """A warning for each kind of thing that materials in use ask for in vain."""
        for kind, names in self._not_drawn.items():
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            warn(self._gltf.files, f"material '{names[0]}'{more}: {kind} is not drawn")

    def _coordinates(
        self, sampling: _Sampling, attribute: Callable[[str], np.ndarray | None], place: str, kind: str
    ) -> np.ndarray | None:
        """Texture coordinates (N, 2); None, with a warning, where the primitive has none."""
        uvs = attribute(f"TEXCOORD_{sampling.uv_set}")
        if uvs is None:
            warn(self._gltf.files, f"{place}: has no TEXCOORD_{sampling.uv_set}, drawn without its {kind}")
            return None
        return floats(uvs) if sampling.transform is None else _transformed(floats(uvs), sampling.transform)

    def _variant(self, material: Material, kind: str, layout: _Layout | None) -> Material:
        """One object for each way in which a material differs between primitives; without the picture for no layout."""
        key = id(material), kind, layout
        if key not in self._variants:
            self._variants[key] = _with_layout(material, kind, layout)
        return self._variants[key]

    def _surface(self, index: int | None) -> _Surface:
        if index not in self._surfaces:
            material = self._gltf.item("materials", index or 0, "primitive")
            self._surfaces[index] = self._read_surface(material, f"materials[{index}] '{material.name}'")
        return self._surfaces[index]

    def _read_surface(self, source: GltfMaterial, place: str) -> _Surface:
        if source.alpha_mode not in ("OPAQUE", "MASK", "BLEND"):
            raise self._gltf.fail(f"{place}: alphaMode '{source.alpha_mode}'; expected OPAQUE, MASK or BLEND")
        pbr = source.pbr_metallic_roughness
        factor, info = pbr.base_color_factor, pbr.base_color_texture
        if "KHR_materials_pbrSpecularGlossiness" in source.extensions:
            gloss = self._extension(source, "KHR_materials_pbrSpecularGlossiness", _SpecularGlossiness, place)
            factor, info = gloss.diffuse_factor, gloss.diffuse_texture
        self._note_what_is_not_drawn(source)
        material = Material(
            source.name or "default", factor, None, source.alpha_mode, source.alpha_cutoff, source.double_sided
        )
        color = normals = None
        if info is not None:
            texture = self._pixels(info, place)
            material = replace(material, texture=texture)
            color = None if texture is None else self._sampling(info, place)
        info = source.normal_texture
        if info is not None and "KHR_materials_unlit" not in source.extensions:
            picture = read_normals(self._gltf.files, material.name, lambda: self._pixels(info, place))
            if picture is not None:
                material = replace(material, normal_map=NormalMap(picture, info.scale))
                normals = self._sampling(info, place)
        return _Surface(finished(self._gltf.files, material), color, normals)

    def _note_what_is_not_drawn(self, source: GltfMaterial) -> None:
        if "KHR_materials_unlit" in source.extensions:
            return
        pbr = source.pbr_metallic_roughness
        # The factors are 1 where a file says nothing, and then it does not mean polished metal.
        stated = pbr.metallic_factor > 0 and (pbr.metallic_factor, pbr.roughness_factor) != (1, 1)
        kinds = {
            "emission": any(source.emissive_factor),
            "occlusion": source.occlusion_texture is not None,
            "metalness": pbr.metallic_roughness_texture is not None or stated,
        }
        for kind in (kind for kind, asked in kinds.items() if asked):
            self._not_drawn.setdefault(kind, []).append(source.name or "default")

    def _extension(self, holder: Any, name: str, schema: Any, place: str) -> Any:
        try:
            return msgspec.convert(holder.extensions[name], schema, strict=False)
        except msgspec.ValidationError as error:
            raise self._gltf.fail(f"{place}: {name}: {error}") from error

    def _sampling(self, info: TextureInfo, place: str) -> _Sampling:
        transform, uv_set, wraps = None, info.tex_coord, (0, 0)
        if "KHR_texture_transform" in info.extensions:
            transform = self._extension(info, "KHR_texture_transform", _Transform, place)
            uv_set = uv_set if transform.tex_coord is None else transform.tex_coord
        sampler = self._gltf.item("textures", info.index, place).sampler
        if sampler is not None:
            found = self._gltf.item("samplers", sampler, f"textures[{info.index}]")
            wraps = found.wrap_s, found.wrap_t
        return _Sampling(uv_set, transform, wraps)

    def _pixels(self, info: TextureInfo, place: str) -> np.ndarray | None:
        texture = self._gltf.item("textures", info.index, place)
        source = texture.extensions.get("EXT_texture_webp", {}).get("source", texture.source)
        if source is None:
            names = ", ".join(texture.extensions) or "no source"
            raise self._gltf.fail(
                f"{place}: textures[{info.index}] has only {names}; expected a PNG, JPEG or WebP image"
            )
        content, image_place = self._gltf.image(source, f"textures[{info.index}]")
        if isinstance(content, str):
            return read_texture(self._gltf.files, content, image_place, self._allow_missing_textures)
        return decode_texture(self._gltf.files, content, image_place)


def _with_layout(material: Material, kind: str, layout: _Layout | None) -> Material:
    if kind == "texture":
        if material.texture is None or layout is None:
            return replace(material, texture=None)
        return replace(material, texture=mirrored(material.texture, layout.across, layout.down), clamp=layout.clamp)
    if material.normal_map is None or layout is None:
        return replace(material, normal_map=None)
    picture = mirrored(material.normal_map.picture, layout.across, layout.down)
    return replace(material, normal_map=replace(material.normal_map, picture=picture, clamp=layout.clamp))


def _transformed(uvs: np.ndarray, transform: _Transform) -> np.ndarray:
    """KHR_texture_transform: scale, then turn counter-clockwise on the picture (v runs down), then shift."""
    u, v = (uvs * np.array(transform.scale)).T
    cos, sin = np.cos(transform.rotation), np.sin(transform.rotation)
    turned = np.column_stack([cos * u + sin * v, -sin * u + cos * v])
    return (turned + np.array(transform.offset)).astype(np.float32)
