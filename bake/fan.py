"""From a model to a fan: frame the views, capture them, code the normals."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake.capture import Capture
from bake.resolve import CapturedView, TileLayers, dilate, resolve
from bake.settings import RING_ELEVATION_DEG, camera_bases
from impostor.checks import check_type
from impostor.errors import ModelError, SettingsError
from impostor.fan import DEPTH_CODES, Fan
from impostor.model import Model
from impostor.normal_code import mip_codes
from impostor.views import Views, frame

DILATION = 2  # texels past the silhouette: what bilinear filtering of a view can reach
VIEWS_AT_ONCE = 16  # exact normals are held for so many views only
SMALLEST_MIP = 4  # texels
SPARED_BITS = 4  # of depth: 12 are finer than a quarter of a texel, and the file a fifth smaller
FARTHEST = 1e6  # bounding radii; from there a perspective picture is an orthographic one, but for rounding
PLANE_OFFSET = 0.5  # of the way from the centre to the surface
STEEPEST_PLANE = 1.5  # slope; steeper quads lose more of their sides than they gain in the middle


def bake_fan(
    model: Model,
    *,
    views: int = 96,
    elevation_deg: float | None = None,
    layout: str = "ring",
    size: int = 256,
    distance: float = np.inf,
    samples: int | None = None,
    up: str = "y",
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> Fan:
    """Bake a model into a fan.

    Parameters
    ----------
    model : Model
    views : int
        Number of cameras.
    elevation_deg : float, optional
        Of a ring of cameras, in degrees; 15 if not given. Other layouts take none.
    layout : {"ring", "hemisphere", "sphere"}
    size : int
        Side of a tile in texels.
    distance : float
        From the object to a perspective camera's eye in metres; orthographic if infinite.
    samples : int, optional
        Samples along a texel's side; see `bake.capture.Capture`.
    up : str
        The up axis that the model was loaded with; only recorded.
    progress : callable
        Called with views done and views in all.

    Returns
    -------
    Fan

    Raises
    ------
    SettingsError
        A number or a choice out of range, or views in which nothing of the object is seen.
    ModelError
        Nothing is seen of an object that is nowhere opaque.
    GpuError
        No OpenGL context.

    References
    ----------
    Dinh, Metoyer, Turk, figures 1 and 3.
    """
    check_type("model", model, Model, ", as impostor.load_model gives")
    bases = camera_bases(views, elevation_deg, layout, size, distance, samples)
    views, size, samples = int(views), int(size), samples and int(samples)  # NumPy's own are not for a manifest
    cameras = frame(bases, np.concatenate([part.positions for part in model.primitives]), size, distance)
    if FARTHEST * model.radius < distance < np.inf:
        most = f"at most {FARTHEST * model.radius:.4g} m for this object, or none for an orthographic camera"
        raise SettingsError("distance", f"{distance:g} m; expected {most}")
    layers = _Layers(views, size)
    # Resolving and coding one view overlaps with drawing the next.
    with Capture(model, size, samples) as capture, ThreadPoolExecutor(1) as worker:
        pending: list[Future[None]] = []
        for index in range(views):
            captured = capture.view(cameras[index])
            pending.append(worker.submit(layers.add, index, captured, capture.samples))
            if len(pending) > 2:
                pending.pop(0).result()
            progress(index + 1, views)
        for future in pending:
            future.result()
        samples = capture.samples
    if layout == "ring" and elevation_deg is None:
        elevation_deg = RING_ELEVATION_DEG
    settings = {
        "views": views,
        "elevation": elevation_deg,
        "layout": layout,
        "size": size,
        "perspective": None if np.isinf(distance) else distance,
        "samples": samples,
        "up": up,
    }
    return layers.fan(model, layout, cameras, settings)


class _Layers:
    """The layers of a fan while its views come in, in order."""

    def __init__(self, views: int, size: int):
        self._views = views
        self._level_sizes = [size]
        while self._level_sizes[-1] % 2 == 0 and self._level_sizes[-1] // 2 >= SMALLEST_MIP:
            self._level_sizes.append(self._level_sizes[-1] // 2)
        self._color = np.zeros((views, size, size, 4), np.uint8)
        self._depth = np.zeros((views, size, size), np.uint16)
        self._normal = [np.zeros((views, side, side), np.uint8) for side in self._level_sizes]
        self._waiting: list[TileLayers] = []

    def add(self, index: int, captured: CapturedView, samples: int) -> None:
        """Take in the next view; normals are coded for several views at once."""
        self._waiting.append(resolve(captured, samples))
        if len(self._waiting) == VIEWS_AT_ONCE or index == self._views - 1:
            self._code(index + 1 - len(self._waiting))
            self._waiting.clear()

    def _code(self, first: int) -> None:
        names = TileLayers.__dataclass_fields__
        stack = TileLayers(*(np.stack([getattr(tile, name) for tile in self._waiting]) for name in names))
        layers, filled = dilate(stack, DILATION)
        part = slice(first, first + len(self._waiting))
        self._color[part] = layers.color
        self._depth[part] = np.rint(layers.depth * (DEPTH_CODES >> SPARED_BITS)).astype(np.uint16) << SPARED_BITS
        covered = layers.coverage > 0
        levels = mip_codes(layers.normal, layers.coverage, len(self._level_sizes), mask=covered | filled)
        for stored, codes in zip(self._normal, levels, strict=True):
            stored[part] = codes

    def fan(self, model: Model, layout: str, views: Views, settings: dict[str, Any]) -> Fan:
        """All of it, as a fan."""
        if not self._color[..., 3].any():
            found = "the object covers no texel of any view"
            if all(part.material.alpha_mode != "OPAQUE" for part in model.primitives):
                raise ModelError(model.name, f"{found}; expected a model whose alpha does not cut all of it out")
            raise SettingsError("size", f"{found}; expected larger tiles, or cameras that do not see it edge-on")
        silhouette: NDArray[np.bool_] = self._color[..., 3] >= 128
        source = {"name": model.name, "sha256": model.source_hash}
        views = replace(views, plane=self._planes(views, silhouette))
        normal, sphere = tuple(self._normal), (model.bounds, model.radius)
        return Fan(model.name, layout, views, self._color, normal, self._depth, silhouette, source, settings, *sphere)

    def _planes(self, views: Views, silhouette: NDArray[np.bool_]) -> NDArray[np.float64]:
        """The plane (V, 3) that each view is drawn in: the least-squares one of its surface, moved half way back.

        The surface itself would be best for what lies inside the outline, the centre for the outline: half way
        between keeps nearly all of the one's PSNR and loses nothing of the other's silhouette.
        """
        size = silhouette.shape[-1]
        across = (np.arange(size) + 0.5) * (2 / size) - 1
        planes = np.zeros((len(views), 3))
        for plane, view, mask, codes in zip(planes, views, silhouette, self._depth, strict=True):
            rows, columns = np.nonzero(mask)
            if len(rows) == 0:
                continue
            low, high = view.depth_range
            z = low + codes[mask] * ((high - low) / DEPTH_CODES)
            plane[0] = z.mean()
            if np.isinf(view.distance):
                # A perspective picture on a tilted quad would need a projective texture.
                points = np.stack([across[columns], -across[rows]], axis=-1) * view.radius
                middle = points.mean(axis=0)
                centred = points - middle
                slope = np.linalg.lstsq(centred, z - plane[0], rcond=1e-6)[0]
                slope *= min(1, STEEPEST_PLANE / max(np.hypot(*slope), 1e-12))
                plane[:] = plane[0] - slope @ middle, *slope
            plane[0] *= PLANE_OFFSET
        return planes
