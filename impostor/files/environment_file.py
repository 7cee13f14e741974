"""Environments as files: a panorama, a cross, or six faces of a cube map."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impostor.checks import check_type
from impostor.environment import Environment
from impostor.environment.environment import FACE_SIZES, is_face_size
from impostor.environment.panorama import (
    default_size,
    faces_from_panorama,
    flipped_faces,
    panorama_from_faces,
    resized_faces,
)
from impostor.errors import EnvironmentFileError, OutputError, SettingsError
from impostor.files.cube_files import (
    NAMES,
    faces_from_pictures,
    faces_of_cross,
    find_faces,
    pictures_from_faces,
    read_cube,
)
from impostor.files.output import atomic_output, check_output
from impostor.files.radiance_file import WRITTEN, FilePath, picture_size, read_radiance, write_radiance
from impostor.paths import check_path


def read_environment(
    path: FilePath,
    size: int | None = None,
    *,
    exposure: float = 1.0,
    mirrored: bool = False,
    flip_y: bool = False,
) -> Environment:
    """Read an environment map.

    Parameters
    ----------
    path : path-like
        One picture: a panorama, twice as wide as high, or a horizontal cross, 4:3, whose middle row is left, front,
        right, back. Or a folder, or a name with one `*`, of six square pictures named posx, negx, posy, negy, posz,
        negz; px, nx and so on; or right, left, top (or up), bottom (or down), front, back.
    size : int, optional
        Side of the environment's faces, a power of two; without it the nearest one that keeps the file's texels, up
        to 1024.
    exposure : float
        Multiplies the light.
    mirrored : bool
        The map is drawn for the other handedness: it lies as it is mirrored in the plane z = 0. As long as a map
        shows what someone inside sees, with writing that can be read, this is False: the middle of a panorama, and
        front or posz, then look along -Z, right or posx along +X. Of the faces of a cube map that was drawn in a
        right-handed world and read back from OpenGL, posz looks along +Z, and writing is mirrored: True.
    flip_y : bool
        The map is upside down, as one that was drawn for DirectX and is used in OpenGL or the reverse: every picture
        of the sides is turned on its head by mirroring, and top and bottom are each other's.

    Returns
    -------
    Environment
        Named as its path.

    Raises
    ------
    EnvironmentFileError
        Pictures that are missing, damaged, too large, of another shape, or have texels that are negative or not
        finite.
    SettingsError
        A size or an exposure that cannot be.
    """
    check_path(path)
    if size is not None and not is_face_size(size):
        raise SettingsError("size", f"{size}; expected {FACE_SIZES}")
    if not 0 < exposure < np.inf:
        raise SettingsError("exposure", f"{exposure:g}; expected a number above 0")
    place = Path(path)
    if place.is_dir() or "*" in place.name:
        faces = _resized(read_cube(place, mirrored), size)
    else:
        faces = _of_one_picture(place, size, mirrored)
    if flip_y:
        faces = flipped_faces(faces, "y")
    most = float(np.finfo(np.float32).max) / max(float(faces.max()), 1.0)
    if exposure > most:
        raise SettingsError("exposure", f"{exposure:g} makes radiance infinite; expected at most {most:g}")
    return Environment(str(path), faces * np.float32(exposure))


def write_environment(path: FilePath, environment: Environment, *, force: bool = False) -> list[Path]:
    """Write an environment, so that `read_environment` gives it again.

    Parameters
    ----------
    path : path-like
        A panorama's name, that ends in .hdr, .exr or .png; the name of six faces' files with one `*` for the name of
        the face; or a folder, for six .exr files. It is made if it is missing.
    environment : Environment
    force : bool
        Replace existing files.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    OutputError
        A file exists, cannot be written, has another suffix, or more than one `*` in its name.

    Notes
    -----
    .exr keeps float32; .hdr 8 bits of mantissa; .png 8 bits on the sRGB curve, light from 0 to 1.
    """
    check_path(path)
    check_type("environment", environment, Environment)
    files = output_files(path, force)
    made = None if files[0].parent.exists() else files[0].parent
    pictures = (
        [panorama_from_faces(environment.faces)] if len(files) == 1 else list(pictures_from_faces(environment.faces))
    )
    if made:
        made.mkdir()
    try:
        with ExitStack() as outputs:
            for file, picture in zip(files, pictures, strict=True):
                write_radiance(outputs.enter_context(atomic_output(file, force)), picture)
    except BaseException:
        if made and not any(made.iterdir()):
            made.rmdir()
        raise
    return files


def describe_map(path: FilePath) -> str:
    """What kind of map a file, a folder or a pattern is, and its size in texels; only headers are read.

    Raises
    ------
    EnvironmentFileError
        As `read_environment`, as far as headers tell.
    """
    place = Path(path)
    six = place.is_dir() or "*" in place.name
    width, height = picture_size(find_faces(place)[0] if six else place)
    kind = "six faces" if six else "panorama" if width == 2 * height else "cross"
    return f"{kind}, {width}x{height}"


def output_files(path: FilePath, force: bool = False) -> list[Path]:
    """The one or six files that `write_environment` will write, none of which may exist unless forced.

    Raises
    ------
    OutputError
        As `write_environment`.
    """
    place = Path(path)
    if place.name.count("*") > 1:
        raise OutputError(path, "has more than one *; expected one, for the name of the face")
    if "*" not in place.name and (place.is_dir() or not place.suffix):
        place = place / "*.exr"
    if place.suffix.lower() not in WRITTEN:
        kinds = ", ".join(WRITTEN)
        raise OutputError(path, f"ends in {place.suffix!r}; expected a name that ends in {kinds}, or a folder")
    files = [place.with_name(place.name.replace("*", name)) for name in NAMES[0]] if "*" in place.name else [place]
    if len(files) == 6 and not place.parent.exists():
        check_output(place.parent, force)
        return files
    for file in files:
        check_output(file, force)
    return files


def _of_one_picture(path: Path, size: int | None, mirrored: bool) -> NDArray[np.float32]:
    picture = read_radiance(path)
    height, width = picture.shape[:2]
    if width == 2 * height:
        faces = faces_from_panorama(picture, size)
        return flipped_faces(faces, "z") if mirrored else faces
    pictures = faces_of_cross(picture)
    if pictures is None:
        expected = (
            "a panorama of 2:1, a horizontal cross of 4:3 with empty corners, or a folder or pattern of six faces"
        )
        raise EnvironmentFileError(path, f"is {width}x{height}; expected {expected}")
    return _resized(faces_from_pictures(pictures, mirrored), size)


def _resized(faces: NDArray[np.float32], size: int | None) -> NDArray[np.float32]:
    return resized_faces(faces, default_size(faces.shape[1]) if size is None else size)
