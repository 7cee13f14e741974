"""Bumps and normal maps: pictures of how normals lean on a polygon mesh, and the tangents that say which way."""

from __future__ import annotations

from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.model import Model, NormalMap, Primitive
from impostor.normal_map import FLAT
from runtime.checks import check_number
from runtime.gl.uploads import check_texture_size
from runtime.meshes.tangents import tangent_mesh


@dataclass(frozen=True, eq=False)
class Bump:
    """A picture of slopes, in the place of a model's own normal maps.

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


class BumpTexture:
    """The picture of bumps or of a normal map on the GPU, with mip levels, and how it is read.

    Attributes
    ----------
    weights : tuple of float
        Of red, green and blue, less the byte that is flat, along tangent, binormal and normal; and of the surface's
        own normal beside them.

    Raises
    ------
    GpuError
        The GPU cannot hold a picture of that size.
    """

    def __init__(self, ctx: moderngl.Context, source: Bump | NormalMap):
        height, width = source.picture.shape[:2]
        if isinstance(source, Bump):
            name, clamp, self.weights = "bump", (False, False), (source.bumpiness, source.bumpiness, 0.0, 1.0)
        else:
            name, clamp, unit = "normal map", source.clamp, 255 / (255 - FLAT)
            self.weights = (source.scale * unit, source.scale * unit, unit, 0.0)
        check_texture_size(ctx, name, width, height)
        self.texture = ctx.texture((width, height), 3, np.ascontiguousarray(source.picture).tobytes(), alignment=1)
        self.texture.repeat_x, self.texture.repeat_y = (not axis for axis in clamp)
        self.texture.build_mipmaps()
        self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()


def with_tangents(name: str, primitive: Primitive) -> Primitive:
    """A part of a model as if its texture were a normal map: with tangents, vertices split where it is mirrored.

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
    return replace(
        primitive,
        positions=mesh.positions,
        normals=mesh.normals,
        uvs=mesh.uvs,
        colors=None if primitive.colors is None else primitive.colors[source],
        triangles=mesh.triangles,
        normal_uvs=mesh.uvs,
        tangents=mesh.tangents,
    )
