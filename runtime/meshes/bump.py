"""Bumps: a picture of slopes on a polygon mesh, and the tangents that say which way it lies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.model import Model, Primitive
from runtime.checks import check_number
from runtime.gl.uploads import check_texture_size
from runtime.meshes.tangents import tangent_mesh


@dataclass(frozen=True, eq=False)
class Bump:
    """A picture of slopes.

    The normal becomes `n + bumpiness * (x * tangent + y * binormal)`, where x and y are red and green as 0 to 1, less
    128 / 255: the byte 128 is flat.

    Parameters
    ----------
    picture : ndarray, (H, W, 3) uint8
        A tangent-space normal map: red leans to the right of the picture, green up. Blue is not read.
    bumpiness : float
        2 shows gentle slopes as they are; less is 0 smoother, below 0 what is raised is hollow.
    plain_fresnel : bool
        Take the part that is mirrored from the normal without bumps, against sparkling edges.

    Raises
    ------
    SettingsError
        Another picture, or a number that is not finite.

    References
    ----------
    Bjorke, "Image-Based Lighting", GPU Gems 19, listing 19-2 and section 19.3.1.
    """

    picture: NDArray[np.uint8]
    bumpiness: float = 2.0
    plain_fresnel: bool = False

    def __post_init__(self):
        picture = self.picture
        if not isinstance(picture, np.ndarray):
            raise SettingsError("bump", f"a picture that is a {type(picture).__name__}; expected an array")
        if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3 or not picture.size:
            raise SettingsError("bump", f"a picture of {picture.shape} {picture.dtype}; expected (H, W, 3) uint8")
        check_number("bump", "bumpiness", self.bumpiness)


def bump_texture(ctx: moderngl.Context, bump: Bump) -> moderngl.Texture:
    """The picture on the GPU, repeating, with mip levels.

    Raises
    ------
    GpuError
        The GPU cannot hold a picture of that size.
    """
    height, width = bump.picture.shape[:2]
    check_texture_size(ctx, "bump", width, height)
    texture = ctx.texture((width, height), 3, np.ascontiguousarray(bump.picture).tobytes(), alignment=1)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture


def with_tangents(name: str, primitive: Primitive) -> tuple[Primitive, NDArray[np.float32]]:
    """A part of a model whose vertices are split where the picture is mirrored, and their tangents, (N, 4) float32.

    Raises
    ------
    SettingsError
        No texture coordinates.
    """
    if primitive.uvs is None:
        raise SettingsError(name, "no texture coordinates; expected a mesh with them, to lay bumps on")
    mesh = tangent_mesh(Model(name, (primitive,)))
    source = np.zeros(len(mesh.positions), np.intp)
    source[mesh.triangles] = primitive.triangles
    split = replace(
        primitive,
        positions=mesh.positions,
        normals=mesh.normals,
        uvs=mesh.uvs,
        colors=None if primitive.colors is None else primitive.colors[source],
        triangles=mesh.triangles,
    )
    return split, mesh.tangents
