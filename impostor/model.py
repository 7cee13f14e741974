"""Any mesh file in, one `Model` out: triangles in world space, grouped by material."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path

import numpy as np

from impostor.errors import ModelError, ModelWarning, SettingsError
from impostor.importing.checks import CHECKS, prepared
from impostor.importing.distance import Distance
from impostor.importing.gltf_scene import read_gltf
from impostor.importing.materials import Material, NormalMap
from impostor.importing.mesh_parts import imported_parts
from impostor.importing.parts import MOST_TRIANGLES, Part, checked, finished_part, joined
from impostor.importing.sources import ModelFiles
from impostor.paths import check_path

__all__ = ["SUFFIXES", "Material", "Model", "NormalMap", "Primitive", "load_model"]

SUFFIXES = tuple(sorted((".glb", ".gltf", *CHECKS)))
SMALLEST_SIZE = 1e-18
"""Metres; squares of what is smaller vanish in 32 bits."""
_UP = {
    "x": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "y": np.eye(3),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
}


@dataclass(frozen=True, eq=False)
class Primitive:
    """Every triangle of one material, in world space.

    Attributes
    ----------
    positions : ndarray, (N, 3) float32
        Metres. Of a model that is many times its size away from the origin float64: there 32 bits would round its shape
        away, and who hands them on in 32 bits takes the middle of `Model.bounds` off first.
    normals : ndarray, (N, 3) float32
        Unit.
    uvs : ndarray, (N, 2) float32, or None
        u right, v down from the picture's top row (v = 0 is row 0); beyond it as the material says.
    colors : ndarray, (N, 4) uint8, or None
        sRGB colour and linear alpha.
    triangles : ndarray, (M, 3) uint32
        Counter-clockwise about their normals; none of zero area.
    material : Material
    normal_uvs : ndarray, (N, 2) float32, or None
        As `uvs`, of the material's normal map; as `tangents` there where it has one.
    tangents : ndarray, (N, 4) float32, or None
        Unit, toward the right of the normal map's picture and across the normals; w is -1 where the picture is
        mirrored, so that `w * cross(normal, tangent)` points up in it. x, y and z are 0 where it lies in no direction
        and the normals are as they are.
    """

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray | None
    colors: np.ndarray | None
    triangles: np.ndarray
    material: Material = field(default_factory=Material)
    normal_uvs: np.ndarray | None = None
    tangents: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """A mesh with its materials: +Y up, right-handed, metres.

    Attributes
    ----------
    name : str
        The file's stem, with a replacement character for what is no UTF-8 in it.
    primitives : tuple of Primitive
        One for each material; at least one.
    source_hash : str
        SHA-256 (hex) of the model file and of every file read with it; empty for arrays.
    """

    name: str
    primitives: tuple[Primitive, ...]
    source_hash: str = ""

    @property
    def triangle_count(self) -> int:
        """Triangles drawn, all instances counted."""
        return sum(len(primitive.triangles) for primitive in self.primitives)

    @property
    def vertex_count(self) -> int:
        """Vertices of all primitives; every one is used."""
        return sum(len(primitive.positions) for primitive in self.primitives)

    @cached_property
    def radius(self) -> float:
        """From the middle of the bounds to the farthest vertex, metres: the bounding sphere."""
        middle = self.bounds.mean(axis=0)
        return float(max(np.linalg.norm(part.positions - middle, axis=1).max() for part in self.primitives))

    @cached_property
    def bounds(self) -> np.ndarray:
        """Least and greatest coordinates, (2, 3) float64, metres."""
        lows, highs = zip(*((p.positions.min(axis=0), p.positions.max(axis=0)) for p in self.primitives), strict=True)
        return np.array([np.min(lows, axis=0), np.max(highs, axis=0)], np.float64)

    @classmethod
    def from_arrays(
        cls, positions, triangles, normals=None, colors=None, uvs=None, material: Material | None = None, name="mesh"
    ) -> Model:
        """A model of one material from arrays.

        Parameters
        ----------
        positions : array_like, (N, 3) float
            Metres.
        triangles : array_like, (M, 3) int
        normals : array_like, (N, 3) float, optional
            Smooth ones are computed when absent.
        colors : array_like, (N, 4) uint8, optional
        uvs : array_like, (N, 2) float, optional
            Of the texture and of the normal map.
        material : Material, optional
        name : str

        Raises
        ------
        ModelError
            When an index is out of range, a number is not finite, or no triangle has any area.
        """
        normals, uvs, colors = (None if array is None else np.asarray(array) for array in (normals, uvs, colors))
        for kind in ("texture", "normal_map"):
            if material is not None and getattr(material, kind) is not None and uvs is None:
                raise ModelError(name, f"material has a {kind} and uvs are None; expected uvs of shape (N, 2)")
        part = Part(
            "arrays",
            np.asarray(positions),
            np.asarray(triangles),
            normals,
            uvs,
            colors,
            material=material or Material(),
            normal_uvs=uvs if material is not None and material.normal_map is not None else None,
        )
        return _assembled(name, name, [part], np.pi, welded=False)


def load_model(path: str | PathLike[str], *, up: str = "y", allow_missing_textures: bool = False) -> Model:
    """Load a mesh file.

    Parameters
    ----------
    path : str or path-like
        glTF 2.0 (.glb, .gltf), OBJ with MTL, PLY, STL, OFF, 3MF or COLLADA (.dae).
    up : {"y", "z"}
        The file's up axis; "z" turns (x, y, z) to (x, z, -y). COLLADA and 3MF state their own, which stands.
    allow_missing_textures : bool
        Draw the base colour, with a warning, where a file that the model refers to is missing.

    Returns
    -------
    Model

    Raises
    ------
    ModelError
        When the file cannot be read, or cannot be drawn as it asks to be: file, place, value, expectation.
    SettingsError
        When `up` is neither "y" nor "z".

    Warns
    -----
    ModelWarning
        When something is drawn differently from what the file asks for.

    Notes
    -----
    Skins and morph targets stand in their rest pose. Where a format says nothing, surfaces are double-sided and
    colours of materials are sRGB values. Missing normals are computed: flat for glTF, as its specification asks, else
    smooth up to a crease of 40 degrees (80 in PLY, whose scans are noisy).
    """
    check_path(path)
    if up not in ("y", "z"):
        raise SettingsError("up", f"'{up}'; expected 'y' or 'z'")
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES and not Path(path).is_dir():
        raise ModelError(path, f"unknown extension '{suffix}'; expected one of {', '.join(SUFFIXES)}")
    try:
        files = ModelFiles(path)
        if suffix in (".glb", ".gltf"):
            parts, crease, axes = read_gltf(files, allow_missing_textures), 0.0, _UP[up]
        else:
            source = prepared(files)
            loader = _mesh_loader(suffix)
            parts, crease = imported_parts(files, source, loader, allow_missing_textures), source.crease
            axes = _UP["z" if up == "z" else source.up or "y"] * source.metres
        world = np.eye(4)
        world[:3, :3] = axes
        for part in parts:
            part.worlds = [world @ matrix for matrix in part.worlds]
        name = os.fsencode(files.path.stem).decode("utf-8", "replace")
        return _assembled(files.path, name, parts, crease, source_hash=files.source_hash())
    except (ModelError, SettingsError):
        raise
    # Whatever third-party code trips over in a broken file is that file's fault to the user: one line, no traceback.
    except Exception as error:
        raise ModelError(
            path, f"cannot be read ({type(error).__name__}: {error}); expected a valid {suffix} file"
        ) from error


def _mesh_loader(suffix: str):
    # Imported when first needed: it takes longer than most other commands.
    from trimesh.exchange.load import mesh_loaders

    return mesh_loaders[suffix[1:]]


def _assembled(where, name: str, parts: list[Part], crease: float, welded=True, source_hash="") -> Model:
    """Check and finish the parts, and join those of one material."""
    total = sum(len(part.triangles) * len(part.worlds) for part in parts)
    if total > MOST_TRIANGLES:
        raise ModelError(where, f"{total} triangles with all instances; expected at most {MOST_TRIANGLES}")
    by_material: dict[int, list[Part]] = {}
    with np.errstate(all="ignore"):
        distance = Distance([checked(where, part) for part in parts])
        for part in parts:
            ready = finished_part(where, part, distance, crease, welded)
            if ready is not None:
                by_material.setdefault(id(ready.material), []).append(ready)
    if not by_material:
        found = f"{total} triangles, none of any area" if total else "no triangles"
        reason = f": {distance.problem}" if total and distance.problem else ""
        raise ModelError(where, f"{found}{reason}; expected at least one to draw")
    if distance.size < SMALLEST_SIZE:
        raise ModelError(where, f"{distance.size:.3g} m large; expected at least {SMALLEST_SIZE:g} m")
    if distance.problem:
        coarse = f"{distance.problem}, coarse for its size of {distance.size:.3g} m"
        warnings.warn(ModelWarning(f"{where}: {coarse}; expected it nearer to the origin"), stacklevel=3)
    return Model(name, tuple(_primitive(joined(group)) for group in by_material.values()), source_hash)


def _primitive(part: Part) -> Primitive:
    def contiguous(array: np.ndarray | None, kind: type = np.float32) -> np.ndarray | None:
        return None if array is None else np.ascontiguousarray(array, kind)

    assert part.normals is not None
    return Primitive(
        np.ascontiguousarray(part.positions),
        np.ascontiguousarray(part.normals, np.float32),
        contiguous(part.uvs),
        contiguous(part.colors, np.uint8),
        np.ascontiguousarray(part.triangles, np.uint32),
        part.material,
        contiguous(part.normal_uvs),
        contiguous(part.tangents),
    )
