"""Parts from what the mesh importer hands over: arrays, materials and textures by its own conventions."""

from __future__ import annotations

import io
import logging
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from impostor.errors import ModelError
from impostor.importing.checks import Prepared, obj_index_problem
from impostor.importing.materials import (
    Material,
    decode_texture,
    finished,
    pixels,
    read_mtl,
    warn,
    with_alpha_mode,
)
from impostor.importing.parts import Part
from impostor.importing.sources import ModelFiles
from impostor.srgb import linear_from_srgb

_GREY = (0.8, 0.8, 0.8, 1.0)
_WHITE = (1.0, 1.0, 1.0, 1.0)
# Otherwise broken references are passed over, and parts of one name replace each other.
_LOADER_OPTIONS = {".dae": {"ignore_broken": False}, ".3mf": {"postprocess": False}}


def imported_parts(files: ModelFiles, source: Prepared, loader: Callable, allow_missing: bool) -> list[Part]:
    """Parts of a checked file.

    Parameters
    ----------
    files : ModelFiles
    source : Prepared
    loader : callable
        The importer's loader of this format: (file object, file_type, resolver) to a dictionary.
    allow_missing : bool
        Draw without textures and MTL files that are missing, with a warning.

    Raises
    ------
    ModelError
    """
    materials = _obj_materials(files, source.data, allow_missing) if files.suffix == ".obj" else None
    resolver = _Resolver(files, None if materials is None else list(materials), allow_missing)
    try:
        with _quiet():
            options = _LOADER_OPTIONS.get(files.suffix, {})
            loaded = loader(io.BytesIO(source.data), file_type=files.suffix[1:], resolver=resolver, **options)
    except IndexError as error:
        problem = obj_index_problem(source.data) if materials is not None else None
        raise ModelError(files.path, problem or f"an index is out of range ({error})") from error
    for warning in resolver.warnings:
        warn(files, warning)
    if resolver.error is not None:
        raise resolver.error
    parts = _Converter(files, materials).parts(loaded)
    found = sum(len(part.triangles) * len(part.worlds) for part in parts)
    if source.triangles is not None and found != source.triangles:
        raise ModelError(files.path, f"{found} whole triangles; expected {source.triangles}")
    for part in parts:
        if part.uvs is None and part.material.texture is not None:
            problem = obj_index_problem(source.data) if materials is not None else None
            warn(files, f"{part.place}: texture not drawn, {problem or 'faces lack texture coordinates'}")
            part.material = replace(part.material, texture=None)
        if part.normal_uvs is None and part.material.normal_map is not None:
            warn(files, f"{part.place}: normal map not drawn, faces lack texture coordinates")
            part.material = replace(part.material, normal_map=None)
    return parts


class _Resolver:
    """Hands the importer files of the model's own folder, and keeps the first error: the importer swallows them."""

    def __init__(self, files: ModelFiles, material_names: list[str] | None, allow_missing: bool):
        self.files = files
        self.file_name = files.path.name
        self.error: ModelError | None = None
        self.warnings: list[str] = []
        self._material_names = material_names
        self._allow_missing = allow_missing

    def get(self, name: str) -> bytes:
        """Bytes of a texture, checked to be one; for OBJ a list of material names, as `read_mtl` reads the rest."""
        if self._material_names is not None:
            return "".join(f"newmtl {material}\n" for material in self._material_names).encode()
        try:
            data = self.files.read(name, "texture")
        except ModelError as error:
            if self._allow_missing:
                self.warnings.append(f"{error.problem}; drawn without it")
            else:
                self.error = self.error or error
            raise
        try:
            decode_texture(self.files, data, f"texture '{name}'")
        except ModelError as error:
            self.error = self.error or error
            raise
        return data

    __getitem__ = get


@contextmanager
def _quiet() -> Iterator[None]:
    """No log lines or warnings of the importer on the user's terminal."""
    logger = logging.getLogger("trimesh")
    level = logger.level
    # A disabled logger would still pass on what its children log.
    logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def _obj_materials(files: ModelFiles, data: bytes, allow_missing: bool) -> dict[str, Material]:
    """Materials of every MTL file that an OBJ names; a warning for those that its faces use and no file defines."""
    materials: dict[str, Material] = {}
    for line in re.findall(rb"^mtllib[ \t]+([^\r\n]+)", data, re.MULTILINE):
        reference = line.decode("utf-8", "replace").strip()
        # One statement may name several files, and one name may hold spaces.
        several = reference.lower().count(".mtl") > 1
        for name in re.findall(r"\S.*?\.mtl(?=\s|$)", reference, re.IGNORECASE) if several else [reference]:
            try:
                materials.update(read_mtl(files, name, allow_missing))
            except ModelError as error:
                if not (allow_missing and "is missing" in error.problem):
                    raise
                warn(files, f"{error.problem}; drawn without its materials")
    used = {
        name.decode("utf-8", "replace").strip() for name in re.findall(rb"^usemtl[ \t]+([^\r\n]+)", data, re.MULTILINE)
    }
    unknown = sorted(used - set(materials))
    if unknown and materials:
        warn(files, f"usemtl '{unknown[0]}': no such material in its MTL files, drawn grey")
    return materials


class _Converter:
    """Turns the importer's meshes into parts, keeping one `Material` object for each distinct material."""

    def __init__(self, files: ModelFiles, obj_materials: dict[str, Material] | None):
        self.files = files
        self.obj_materials = obj_materials
        self.materials: dict[Any, Material] = {}
        self.grey = Material(base_color=_GREY)
        self.white = Material(base_color=_WHITE)

    def parts(self, loaded: dict[str, Any]) -> list[Part]:
        """A part for each mesh that the loaded scene shows."""
        meshes = loaded.get("geometry", {self.files.path.stem: loaded})
        shown: dict[str, list[np.ndarray]] = {}
        for edge in loaded.get("graph") or [{"geometry": name} for name in meshes]:
            if "geometry" in edge:
                shown.setdefault(edge["geometry"], []).append(np.asarray(edge.get("matrix", np.eye(4)), np.float64))
        parts = [self._part(name, meshes[name], worlds) for name, worlds in shown.items()]
        return [part for part in parts if part is not None]

    def _part(self, name: str, mesh: dict[str, Any], worlds: list[np.ndarray]) -> Part | None:
        faces = mesh.get("faces")
        if faces is None or not len(faces):
            return None
        positions = np.asarray(mesh["vertices"])
        triangles, face_of_triangle = _triangulated(faces)
        colors, face_colors = _bytes(mesh.get("vertex_colors")), _bytes(mesh.get("face_colors"))
        if face_colors is not None and len(face_colors) == len(faces):
            face_colors = face_colors[face_of_triangle]
            # Some exporters write plain white for the kind of colour they do not use.
            face_colors = None if colors is not None and (face_colors == face_colors[0]).all() else face_colors
        else:
            face_colors = None
        colors = None if face_colors is not None or colors is None or len(colors) != len(positions) else colors
        visual = mesh.get("visual")
        material = self._material(visual, colors is not None or face_colors is not None)
        drawn = material.texture is not None or material.normal_map is not None
        uvs = _uvs(visual, len(positions)) if drawn else None
        return Part(
            f"mesh '{name}'",
            positions,
            triangles,
            _matching(mesh.get("vertex_normals"), positions),
            uvs if material.texture is not None else None,
            self._without_alpha(colors),
            self._without_alpha(face_colors),
            material,
            worlds,
            normal_uvs=uvs if material.normal_map is not None else None,
        )

    def _without_alpha(self, colors: np.ndarray | None) -> np.ndarray | None:
        if colors is not None and colors[:, 3].min() < 255:
            warn(self.files, "alpha of vertex or face colours is not drawn")
            colors[:, 3] = 255
        return colors

    def _material(self, visual: Any, has_colors: bool) -> Material:
        material = getattr(visual, "material", None)
        if self.obj_materials is not None:
            plain = self.white if has_colors else self.grey
            return self.obj_materials.get(getattr(material, "name", ""), plain)
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        factor = getattr(material, "baseColorFactor", None)
        if image is None and factor is None:
            return self.white if has_colors else self.grey
        key = (id(image), None if factor is None else tuple(factor))
        if key not in self.materials:
            texture = None if image is None else pixels(image)
            base_color = _WHITE if factor is None else _linear_color(np.asarray(factor))
            name = getattr(material, "name", None) or "default"
            self.materials[key] = finished(self.files, with_alpha_mode(Material(name, base_color, texture)))
        return self.materials[key]


def _linear_color(color: np.ndarray) -> tuple[float, float, float, float]:
    """sRGB bytes or fractions as a linear factor."""
    color = color / 255.0 if color.dtype.kind in "iu" else color.astype(np.float64)
    red, green, blue = (float(c) for c in linear_from_srgb(color[:3]))
    return red, green, blue, float(color[3]) if len(color) > 3 else 1.0


def _triangulated(faces: Any) -> tuple[np.ndarray, np.ndarray]:
    """Polygons as fans of triangles, (M, 3), and the polygon of each."""
    if isinstance(faces, np.ndarray) and faces.ndim == 2 and faces.dtype.kind in "iu":
        polygons, sizes = faces.astype(np.int64).reshape(-1), np.full(len(faces), faces.shape[1])
    else:
        rows = [np.asarray(face, np.int64) for face in faces]
        polygons, sizes = np.concatenate(rows), np.array([len(row) for row in rows])
    fans = np.maximum(sizes - 2, 0)
    polygon = np.repeat(np.arange(len(sizes)), fans)
    first = (np.cumsum(sizes) - sizes)[polygon]
    step = np.arange(len(polygon)) - (np.cumsum(fans) - fans)[polygon] + 1
    return polygons[np.column_stack([first, first + step, first + step + 1])], polygon


def _matching(array: Any, positions: np.ndarray) -> np.ndarray | None:
    if array is None or np.shape(array) != positions.shape:
        return None
    return np.asarray(array)


def _uvs(visual: Any, count: int) -> np.ndarray | None:
    """Texture coordinates with v turned to run down from the top row."""
    uvs = getattr(visual, "uv", None)
    if uvs is None or len(uvs) != count:
        return None
    uvs = np.array(uvs, np.float64)[:, :2]
    uvs[:, 1] = 1.0 - uvs[:, 1]
    return uvs


def _bytes(colors: Any) -> np.ndarray | None:
    """Colours of any scale as (N, 4) uint8: integers of full range, fractions, or 0..255 in floats."""
    if colors is None or np.ndim(colors) != 2 or not len(colors) or np.shape(colors)[1] < 3:
        return None
    colors = np.asarray(colors)[:, :4]
    if colors.dtype.kind in "iu":
        scale = 255.0 / np.iinfo(colors.dtype).max if colors.dtype.itemsize < 4 else 1.0
    else:
        scale = 1.0 if np.nanmax(colors) > 1.0 else 255.0
    rgba = np.full((len(colors), 4), 255, np.uint8)
    rgba[:, : colors.shape[1]] = np.rint(np.clip(np.nan_to_num(colors * scale), 0, 255))
    return rgba
