"""Materials of a glTF file: base colour, alpha and the texture with its sampler; and what of them is not drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from impostor.importing.gltf import Gltf, GltfMaterial, Primitive, TextureInfo, Vec2, floats
from impostor.importing.materials import Material, decode_texture, finished, mirrored, read_texture, warn

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


@dataclass(frozen=True, eq=False)
class _Surface:
    """A material and how its texture is reached from the vertices."""

    material: Material
    uv_set: int = 0
    transform: _Transform | None = None
    mirrors: tuple[bool, bool] = (False, False)


class GltfMaterials:
    """The materials of one file, read when a primitive first uses them."""

    def __init__(self, gltf: Gltf, allow_missing_textures: bool):
        self._gltf, self._allow_missing_textures = gltf, allow_missing_textures
        self._surfaces: dict[int | None, _Surface] = {
            None: _Surface(Material(base_color=(1.0, 1.0, 1.0, 1.0), double_sided=False))
        }
        self._variants: dict[tuple[int, str], Material] = {}
        self._not_drawn: dict[str, list[str]] = {}

    def drawn(
        self, primitive: Primitive, attribute: Callable[[str], np.ndarray | None], place: str
    ) -> tuple[Material, np.ndarray | None]:
        """A primitive's material and its texture coordinates as the texture is to be sampled.

        `attribute` gives the primitive's arrays by their names.
        """
        surface = self._surface(primitive.material)
        material = surface.material
        if material.texture is None:
            return material, None
        uvs = attribute(f"TEXCOORD_{surface.uv_set}")
        if uvs is None:
            warn(self._gltf.files, f"{place}: has no TEXCOORD_{surface.uv_set}, drawn without its texture")
            return self._variant(material, "bare", lambda: replace(material, texture=None)), None
        uvs = floats(uvs)
        if surface.transform is not None:
            uvs = _transformed(uvs, surface.transform)
        if any(surface.mirrors) and len(uvs):
            return self._mirrored(surface, uvs)
        return material, uvs

    def tell_what_is_not_drawn(self) -> None:
        """A warning for each kind of thing that materials in use ask for in vain."""
        for kind, names in self._not_drawn.items():
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            warn(self._gltf.files, f"material '{names[0]}'{more}: {kind} is not drawn")

    def _mirrored(self, surface: _Surface, uvs: np.ndarray) -> tuple[Material, np.ndarray]:
        """A sampler that mirrors, as one that repeats a picture and its mirror image beside it.

        Along an axis that the coordinates do not leave it is one that clamps, texel by texel.
        """
        material = surface.material
        low, high = np.nanmin(uvs, axis=0), np.nanmax(uvs, axis=0)
        leaves = (low < -_BEYOND) | (high > 1 + _BEYOND)
        across, down = (bool(axis) for axis in leaves & surface.mirrors)
        clamp_u, clamp_v = (bool(axis) for axis in ~leaves & surface.mirrors | np.array(material.clamp))

        def made() -> Material:
            assert material.texture is not None
            return replace(material, texture=mirrored(material.texture, across, down), clamp=(clamp_u, clamp_v))

        scale = np.where([across, down], np.float32(0.5), np.float32(1))
        return self._variant(material, f"mirrored {across} {down}", made), uvs * scale

    def _variant(self, material: Material, kind: str, make: Callable[[], Material]) -> Material:
        """One object for each way in which a material differs between primitives."""
        if (id(material), kind) not in self._variants:
            self._variants[id(material), kind] = make()
        return self._variants[id(material), kind]

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
        if info is None:
            return _Surface(finished(self._gltf.files, material))
        texture, wraps = self._texture(info, place)
        material = replace(material, texture=texture, clamp=(wraps[0] == _CLAMP, wraps[1] == _CLAMP))
        transform, uv_set = None, info.tex_coord
        if "KHR_texture_transform" in info.extensions:
            transform = self._extension(info, "KHR_texture_transform", _Transform, place)
            uv_set = uv_set if transform.tex_coord is None else transform.tex_coord
        mirrors = wraps[0] == _MIRROR, wraps[1] == _MIRROR
        return _Surface(finished(self._gltf.files, material), uv_set, transform, mirrors)

    def _note_what_is_not_drawn(self, source: GltfMaterial) -> None:
        if "KHR_materials_unlit" in source.extensions:
            return
        pbr = source.pbr_metallic_roughness
        # The factors are 1 where a file says nothing, and then it does not mean polished metal.
        stated = pbr.metallic_factor > 0 and (pbr.metallic_factor, pbr.roughness_factor) != (1, 1)
        kinds = {
            "emission": any(source.emissive_factor),
            "normal map": source.normal_texture is not None,
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

    def _texture(self, info: TextureInfo, place: str) -> tuple[np.ndarray | None, tuple[int, int]]:
        """Pixels, and how the sampler wraps them along u and v."""
        texture = self._gltf.item("textures", info.index, place)
        source = texture.extensions.get("EXT_texture_webp", {}).get("source", texture.source)
        if source is None:
            names = ", ".join(texture.extensions) or "no source"
            raise self._gltf.fail(
                f"{place}: textures[{info.index}] has only {names}; expected a PNG, JPEG or WebP image"
            )
        wraps = 0, 0
        if texture.sampler is not None:
            sampler = self._gltf.item("samplers", texture.sampler, f"textures[{info.index}]")
            wraps = sampler.wrap_s, sampler.wrap_t
        content, image_place = self._gltf.image(source, f"textures[{info.index}]")
        if isinstance(content, str):
            return read_texture(self._gltf.files, content, image_place, self._allow_missing_textures), wraps
        return decode_texture(self._gltf.files, content, image_place), wraps


def _transformed(uvs: np.ndarray, transform: _Transform) -> np.ndarray:
    """KHR_texture_transform: scale, then turn counter-clockwise on the picture (v runs down), then shift."""
    u, v = (uvs * np.array(transform.scale)).T
    cos, sin = np.cos(transform.rotation), np.sin(transform.rotation)
    turned = np.column_stack([cos * u + sin * v, -sin * u + cos * v])
    return (turned + np.array(transform.offset)).astype(np.float32)
