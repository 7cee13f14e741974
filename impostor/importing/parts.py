"""A part: the triangles of one material as a file gives them, checked, moved to the world and given normals."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from impostor.errors import ModelError
from impostor.importing.distance import Distance
from impostor.importing.materials import Material
from impostor.importing.normals import agreeing_winding, computed_normals, face_vectors, repaired_normals, weld
from impostor.importing.tangents import picture_tangents, repaired_tangents

MOST_TRIANGLES = 100_000_000
LARGEST_COORDINATE = 1e18


@dataclass(eq=False)
class Part:
    """Triangles of one material and the places where the scene holds them.

    Attributes
    ----------
    place : str
        Where in the file, for messages.
    positions : ndarray, (N, 3) float
    triangles : ndarray, (M, 3) int
    normals : ndarray, (N, 3) float, or None
    uvs : ndarray, (N, 2) float, or None
        v runs down from the picture's top row.
    colors : ndarray, (N, 4) uint8, or None
        sRGB colour and linear alpha.
    face_colors : ndarray, (M, 4) uint8, or None
    material : Material
    worlds : list of ndarray, (4, 4) float64
        `world_from_part`, one for each instance.
    normal_uvs : ndarray, (N, 2) float, or None
        As `uvs`, of the material's normal map.
    tangents : ndarray, (N, 4) float, or None
        See `picture_tangents`.
    """

    place: str
    positions: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None = None
    uvs: np.ndarray | None = None
    colors: np.ndarray | None = None
    face_colors: np.ndarray | None = None
    material: Material = field(default_factory=Material)
    worlds: list[np.ndarray] = field(default_factory=lambda: [np.eye(4)])
    normal_uvs: np.ndarray | None = None
    tangents: np.ndarray | None = None


def checked(where, part: Part) -> Part:
    """The part with its arrays' shapes, indices and numbers checked, and no vertices that no triangle uses.

    Raises
    ------
    ModelError
        Naming the first index or vertex that is wrong.
    """
    part.positions = np.asarray(part.positions)
    part.triangles = np.asarray(part.triangles).astype(np.int64, copy=False)
    count = len(part.positions)
    if part.positions.ndim != 2 or part.positions.shape[1] != 3:
        raise ModelError(where, f"{part.place}: positions have shape {part.positions.shape}; expected (N, 3)")
    if part.triangles.ndim != 2 or part.triangles.shape[1] != 3:
        raise ModelError(where, f"{part.place}: triangles have shape {part.triangles.shape}; expected (M, 3)")
    for name, width in (("normals", 3), ("uvs", 2), ("colors", 4), ("normal_uvs", 2), ("tangents", 4)):
        array = getattr(part, name)
        if array is not None and array.shape != (count, width):
            raise ModelError(where, f"{part.place}: {name} have shape {array.shape}; expected {(count, width)}")
    if part.colors is not None and part.colors.dtype != np.uint8:
        raise ModelError(where, f"{part.place}: colors are {part.colors.dtype}; expected uint8")
    _check_indices(where, part, count)
    _check_finite(where, part)
    _drop_unused(part)
    return part


def _check_indices(where, part: Part, count: int) -> None:
    outside = (part.triangles < 0) | (part.triangles >= count)
    if outside.any():
        triangle, corner = np.argwhere(outside)[0]
        index = part.triangles[triangle, corner]
        raise ModelError(where, f"{part.place}: triangle {triangle} uses vertex {index}; expected 0..{count - 1}")


def _check_finite(where, part: Part) -> None:
    for name in ("positions", "uvs", "normal_uvs"):
        array = getattr(part, name)
        if array is None or np.isfinite(array).all():
            continue
        used = np.zeros(len(array), bool)
        used[part.triangles] = True
        bad = np.flatnonzero(used & ~np.isfinite(array).all(axis=1))
        if len(bad):
            value = tuple(float(x) for x in array[bad[0]])
            raise ModelError(where, f"{part.place}: {name} of vertex {bad[0]} are {value}; expected finite numbers")


def finished_part(where, part: Part, distance: Distance, crease: float, welded: bool = True) -> Part | None:
    """A checked part in world space: instances expanded, degenerate triangles dropped, normals unit and agreeing.

    With a normal map come tangents for it.

    Its positions have 32 bits where it is not far from the origin, and 64 bits else.

    Returns
    -------
    Part or None
        None when no triangle of any area is left.

    Raises
    ------
    ModelError
        When a coordinate is too large for sums of squares in 32-bit floats.
    """
    part, far = _expanded(where, part, distance.origin), distance.origin.any()
    # The file's own rounding parts what its author had joined.
    step = 2 * distance.step if far else 0.0
    if welded and _is_soup(part):
        _merge_vertices(part, step)
    keep = (face_vectors(part.positions, part.triangles) != 0).any(axis=1)
    if not keep.all():
        part.triangles = part.triangles[keep]
        part.face_colors = None if part.face_colors is None else part.face_colors[keep]
    if not len(part.triangles):
        return None
    if part.normals is None:
        normals, part.triangles, source = computed_normals(part.positions, part.triangles, crease, welded, step)
        _take(part, source)
        part.normals = normals
    else:
        part.normals = repaired_normals(part.normals, part.positions, part.triangles)
        part.triangles = agreeing_winding(part.positions, part.triangles, part.normals)
    if part.face_colors is not None:
        _take(part, part.triangles.reshape(-1))
        part.colors = np.repeat(part.face_colors, 3, axis=0)
        part.triangles = np.arange(part.triangles.size).reshape(-1, 3)
    _drop_unused(part)
    if part.normal_uvs is not None:
        _lay_normal_map(part)
    if far:
        part.positions = part.positions + distance.origin
    return part


def _lay_normal_map(part: Part) -> None:
    assert part.normals is not None and part.normal_uvs is not None
    if part.tangents is not None:
        part.tangents = repaired_tangents(part.tangents, part.normals)
        return
    tangents, part.triangles, source = picture_tangents(part.positions, part.normals, part.normal_uvs, part.triangles)
    _take(part, source)
    part.tangents = tangents


def joined(parts: list[Part]) -> Part:
    """Parts of one material as one part; colours absent from some are white there."""
    if len(parts) == 1:
        return parts[0]
    material = parts[0].material
    offsets = np.cumsum([0, *(len(part.positions) for part in parts[:-1])])
    triangles = [part.triangles + offset for part, offset in zip(parts, offsets, strict=True)]
    has_colors = any(part.colors is not None for part in parts)
    has_uvs = all(part.uvs is not None for part in parts)
    has_map = all(part.tangents is not None for part in parts)
    white = [np.full((len(part.positions), 4), 255, np.uint8) if part.colors is None else part.colors for part in parts]
    return Part(
        parts[0].place,
        np.concatenate([part.positions for part in parts]),
        np.concatenate(triangles),
        np.concatenate([part.normals for part in parts if part.normals is not None]),
        np.concatenate([part.uvs for part in parts if part.uvs is not None]) if has_uvs else None,
        np.concatenate(white) if has_colors else None,
        None,
        material,
        normal_uvs=np.concatenate([part.normal_uvs for part in parts if part.normal_uvs is not None])
        if has_map
        else None,
        tangents=np.concatenate([part.tangents for part in parts if part.tangents is not None]) if has_map else None,
    )


def normal_matrix(linear: np.ndarray) -> np.ndarray:
    """What turns normals when `linear` (..., 3, 3) turns positions: its cofactors, kept outward under mirroring."""
    a, b, c = linear[..., 0, :], linear[..., 1, :], linear[..., 2, :]
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)
    mirrored = np.einsum("...i,...i->...", a, np.cross(b, c)) < 0
    return np.where(mirrored[..., None, None], -cofactors, cofactors)


def _expanded(where, part: Part, origin: np.ndarray) -> Part:
    """Every instance of a part, less the origin."""
    count, instances = len(part.positions), len(part.worlds)
    worlds = np.asarray(part.worlds, np.float64)
    positions = part.positions.astype(np.float64) if instances > 1 or not _is_identity(worlds) else part.positions
    if positions is not part.positions:
        positions = np.concatenate([positions @ world[:3, :3].T + world[:3, 3] for world in worlds])
    if not (np.abs(positions) <= LARGEST_COORDINATE).all():
        raise ModelError(
            where, f"{part.place}: a coordinate in the scene is beyond {LARGEST_COORDINATE:g} or not finite"
        )
    normals = part.normals
    if normals is not None and positions is not part.positions:
        normals = np.concatenate([normals @ normal_matrix(world[:3, :3]).T for world in worlds])
    tangents = part.tangents
    if tangents is not None and positions is not part.positions:
        tangents = np.concatenate([_turned_tangents(tangents, world[:3, :3]) for world in worlds])
    triangles = [_wound(part.triangles, world) + index * count for index, world in enumerate(worlds)]
    return Part(
        part.place,
        (positions - origin if origin.any() else positions).astype(np.float32),
        np.concatenate(triangles),
        normals,
        _tiled(part.uvs, instances),
        _tiled(part.colors, instances),
        _tiled(part.face_colors, instances),
        part.material,
        normal_uvs=_tiled(part.normal_uvs, instances),
        tangents=tangents,
    )


def _is_identity(worlds: np.ndarray) -> bool:
    return bool((worlds == np.eye(4)).all())


def _wound(triangles: np.ndarray, world: np.ndarray) -> np.ndarray:
    return triangles[:, ::-1] if np.linalg.det(world[:3, :3]) < 0 else triangles


def _turned_tangents(tangents: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """Tangents lie in the surface and turn with it; what mirrors it mirrors the picture."""
    return np.column_stack([tangents[:, :3] @ linear.T, tangents[:, 3] * np.sign(np.linalg.det(linear))])


def _tiled(array: np.ndarray | None, instances: int) -> np.ndarray | None:
    return array if array is None or instances == 1 else np.tile(array, (instances, 1))


def _is_soup(part: Part) -> bool:
    """Whether no two triangles share a vertex and vertices hold positions alone, as in STL."""
    beside = part.normals, part.uvs, part.colors, part.face_colors, part.normal_uvs
    plain = all(array is None for array in beside)
    return plain and 0 < len(part.positions) == part.triangles.size


def _merge_vertices(part: Part, step: float) -> None:
    number = weld(part.positions, step)
    first = np.empty(int(number.max()) + 1, np.int64)
    first[number] = np.arange(len(number))
    part.positions = part.positions[first]
    part.triangles = number[part.triangles]


def _drop_unused(part: Part) -> None:
    used = np.zeros(len(part.positions), bool)
    used[part.triangles] = True
    if not used.all():
        part.triangles = (np.cumsum(used) - 1)[part.triangles]
        _take(part, np.flatnonzero(used))


def _take(part: Part, source: np.ndarray) -> None:
    for name in ("positions", "normals", "uvs", "colors", "normal_uvs", "tangents"):
        array = getattr(part, name)
        if array is not None:
            setattr(part, name, array[source])
