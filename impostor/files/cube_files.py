"""Six pictures that make a cube map: their names, and how they lie in it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impostor.environment.panorama import flipped_faces
from impostor.errors import EnvironmentFileError
from impostor.files.radiance_file import READ, read_radiance

NAMES = (
    ("posx", "negx", "posy", "negy", "posz", "negz"),
    ("px", "nx", "py", "ny", "pz", "nz"),
    ("right", "left", "top", "bottom", "front", "back"),
    ("right", "left", "up", "down", "front", "back"),
)
"""What each face may be called, in the order of `cube.FACES`."""
_LAST_WORD = re.compile(r"(?:.*[^a-z0-9])?([a-z]+)", re.DOTALL)


def read_cube(path: Path, mirrored: bool = False) -> NDArray[np.float32]:
    """Six square pictures of one size.

    Parameters
    ----------
    path : Path
        A folder, or a name with one `*` for the name of the face.
    mirrored : bool
        See `environment_file.read_environment`.

    Returns
    -------
    ndarray, (6, N, N, 3) float32
        In the order of `cube.FACE_AXES`, N as it is in the files.

    Raises
    ------
    EnvironmentFileError
        Not just six faces, faces that are not square or not of one size, or a picture that cannot be read.
    """
    files = find_faces(path)
    pictures = []
    for file in files:
        pictures.append(read_radiance(file))
        height, width = pictures[-1].shape[:2]
        if width != height:
            raise EnvironmentFileError(file, f"is {width}x{height}; expected a square face")
        first = len(pictures[0])
        if width != first:
            expected = f"expected {first}x{first} as {files[0].name}"
            raise EnvironmentFileError(file, f"is {width}x{width}; {expected}")
    return faces_from_pictures(np.stack(pictures), mirrored)


def find_faces(path: Path) -> list[Path]:
    """The files of the six faces, in the order of `cube.FACES`.

    Raises
    ------
    EnvironmentFileError
        A face is missing, or there more than once; more than one `*`.
    """
    pattern = None if path.is_dir() else path.name.lower()
    if pattern is not None and pattern.count("*") > 1:
        raise EnvironmentFileError(path, "has more than one *; expected one, for the name of the face")
    folder = path if pattern is None else path.parent
    if not folder.is_dir():
        raise EnvironmentFileError(path, f"directory {str(folder)!r} does not exist; expected one that does")
    found: dict[int, list[Path]] = {}
    family = NAMES[0]
    for file in sorted(folder.iterdir()):
        name = _face_name(file, pattern)
        for names in NAMES:
            if name in names and file.is_file():
                found.setdefault(names.index(name), []).append(file)
                family = names
                break
    for face, files in sorted(found.items()):
        if len(files) > 1:
            there = ", ".join(file.name for file in files)
            raise EnvironmentFileError(
                path, f"has face {family[face]} more than once ({there}); expected a name with *"
            )
    missing = [family[face] for face in range(6) if face not in found]
    if missing:
        lacks = "has none of the six faces" if not found else f"lacks face {', '.join(missing)}"
        raise EnvironmentFileError(path, f"{lacks}; expected pictures named {', '.join(family)}")
    return [found[face][0] for face in range(6)]


def faces_from_pictures(pictures: NDArray[np.float32], mirrored: bool = False) -> NDArray[np.float32]:
    """Faces as they are in files, (6, N, N, 3), in the order of `cube.FACE_AXES`.

    Pictures seen from inside are OpenGL's faces in a world where +Z, in front, has +X to its right: ours mirrored.
    """
    return pictures if mirrored else flipped_faces(pictures, "z")


def pictures_from_faces(faces: NDArray[np.float32]) -> NDArray[np.float32]:
    """The reverse of `faces_from_pictures`: photographs from inside."""
    return flipped_faces(faces, "z")


def faces_of_cross(picture: NDArray[np.float32]) -> NDArray[np.float32] | None:
    """Six pictures (6, N, N, 3) cut from a horizontal cross, with the four faces around in its middle row.

    None where the picture is no cross: not 4:3, or with something in a corner that a cross leaves empty.
    """
    side = picture.shape[0] // 3
    if picture.shape[:2] != (3 * side, 4 * side) or not side:
        return None
    cells = picture.reshape(3, side, 4, side, 3).swapaxes(1, 2)
    edge = side // 8  # lossy compression smears the faces into the corners
    corners = cells[::2, [0, 2, 3], edge : side - edge, edge : side - edge]
    if np.ptp(corners, axis=(2, 3)).max() > 0.02 * picture.max():
        return None
    return cells[[1, 1, 0, 2, 1, 1], [2, 0, 1, 1, 1, 3]]


def _face_name(file: Path, pattern: str | None) -> str | None:
    """The word in a file's name that may be the name of a face."""
    if file.suffix.lower() not in READ:
        return None
    if pattern is None:
        word = _LAST_WORD.fullmatch(file.stem.lower())
        return word and word[1]
    before, _, after = pattern.partition("*")
    name = file.name.lower()
    fits = len(name) > len(before + after) and name.startswith(before) and name.endswith(after)
    return name[len(before) : len(name) - len(after)] if fits else None
