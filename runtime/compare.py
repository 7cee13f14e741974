"""Impostor against mesh: how far a fan's pictures are from what it was baked from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass

import moderngl
import numpy as np
from flip_evaluator import evaluate
from numpy.typing import ArrayLike, NDArray
from skimage.metrics import structural_similarity

from impostor.errors import SettingsError
from impostor.fan import Fan
from impostor.lighting import DirectionalLight
from impostor.model import Model
from impostor.views import direction
from runtime.gl.offscreen import Offscreen
from runtime.lights.settings import DEFAULT_AMBIENT, DEFAULT_LIGHTS
from runtime.renderer import ImpostorRenderer
from runtime.viewing.cameras import FRAME_MARGIN, Camera
from runtime.viewing.recentring import moved_camera, recentred

BACKGROUND = (0.4, 0.5, 0.6, 1.0)
MESH_SAMPLES = 4
SSIM_WINDOW = 7
METHOD = "nearest"  # how views between the views are made
HIGHEST_PSNR = 100.0  # dB, of equal pictures: JSON has no infinity


@dataclass(frozen=True)
class Row:
    """Means over the cameras of one elevation offset.

    Parameters
    ----------
    method : str
        How views between the views are made; "nearest" shows the nearest one.
    offset_deg : float
        Camera elevation above the fan's.
    psnr_db : float
        Of the sRGB values over the object's pixels: those that mesh or impostor touch.
    ssim : float
        Mean structural similarity over the object's pixels.
    flip : float
        Mean FLIP error over the object's pixels; 0 is equal.
    iou : float
        Intersection over union of the silhouettes (coverage of at least one half).
    """

    method: str
    offset_deg: float
    psnr_db: float
    ssim: float
    flip: float
    iou: float


@dataclass(frozen=True, eq=False)
class Pair:
    """One camera's two pictures: (S, S, 4) uint8 each, sRGB, premultiplied alpha."""

    mesh: NDArray[np.uint8]
    impostor: NDArray[np.uint8]


def between_cameras(fan: Fan, count: int) -> list[float]:
    """Azimuths in radians, spread around the object, that lie between the fan's views at every fraction of the gap."""
    views = len(fan.views)
    index = np.floor(np.arange(count) * views / count)
    return ((index + (np.arange(count) + 0.5) / count) * 2 * np.pi / views).tolist()


def between_directions(fan: Fan, count: int) -> list[tuple[float, float]]:
    """Azimuths and elevations in radians of cameras between the fan's views, whatever its layout."""
    if fan.layout == "ring":
        elevation = float(np.arcsin(fan.views.basis[0, 2, 1]))
        return [(azimuth, elevation) for azimuth in between_cameras(fan, count)]
    back = fan.views.basis[:, 2]
    index = np.arange(count) * len(back) // count
    near = np.argsort(-(back[index] @ back.T), axis=1)[:, min(1, len(back) - 1)]
    part = ((np.arange(count) + 0.5) / count)[:, None]
    x, y, z = ((1 - part) * back[index] + part * back[near]).T
    return list(zip(np.arctan2(x, z).tolist(), np.arctan2(y, np.hypot(x, z)).tolist(), strict=True))


class Comparison:
    """Renders a fan and its mesh through the same cameras and lights.

    Parameters
    ----------
    ctx : moderngl.Context
    fan : Fan
    model : Model
    size : int, optional
        Side of the pictures in pixels; that of the fan's tiles if not given.
    lights, ambient
        As `ImpostorRenderer` takes them.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        fan: Fan,
        model: Model,
        size: int | None = None,
        lights: Sequence[DirectionalLight] = DEFAULT_LIGHTS,
        ambient: ArrayLike = DEFAULT_AMBIENT,
    ):
        size = fan.size if size is None else size
        self._fan, self._sphere = fan, (model.bounds.mean(axis=0), model.radius)
        (drawn_fan, fan_middle), (drawn_model, self._middle) = recentred(fan), recentred(model)
        self._fans, self._meshes = ImpostorRenderer(ctx), ImpostorRenderer(ctx)
        for renderer in (self._fans, self._meshes):
            renderer.lights, renderer.ambient = lights, ambient
        self._fans.add(drawn_fan, fan_middle - self._middle)
        self._meshes.add_mesh(drawn_model)
        self._impostor = Offscreen(ctx, size, size)
        self._truth = Offscreen(ctx, size, size, MESH_SAMPLES)

    def pair(self, azimuth: float, elevation: float) -> Pair:
        """Both pictures from one camera (radians), on nothing; it has the perspective of the fan's own cameras."""
        matrices = moved_camera(self._camera(azimuth, elevation), self._middle).matrices
        self._truth.clear()
        self._meshes.draw_meshes(*matrices)
        self._impostor.clear()
        self._fans.draw(*matrices)
        return Pair(self._truth.color(), self._impostor.color())

    def _camera(self, azimuth: float, elevation: float) -> Camera:
        (center, radius), distance = self._sphere, self._fan.views.distance
        if np.isinf(distance):
            return Camera.orthographic(center, radius, azimuth, elevation)
        fov_deg = 2 * np.degrees(np.arcsin(min(FRAME_MARGIN * radius / distance, 0.99)))
        eye = center + distance * direction(azimuth, elevation)
        return Camera.perspective(eye, center, fov_deg, 1, max(distance - radius, 0.01 * distance), distance + radius)

    def rows(
        self,
        offsets_deg: Sequence[float],
        cameras: int = 8,
        progress: Callable[[int, int], object] = lambda done, total: None,
    ) -> Iterator[tuple[Row, Pair]]:
        """Measure at each elevation offset; yields a row and its first camera's pair.

        Raises
        ------
        SettingsError
            Fewer than one camera, or cameras that would stand beyond the pole of a ring.
        """
        if cameras < 1:
            raise SettingsError("cameras", f"{cameras}; expected at least 1")
        directions = between_directions(self._fan, cameras)
        if self._fan.layout == "ring":
            _check_offsets(offsets_deg, np.degrees(directions[0][1]))
        for number, offset in enumerate(offsets_deg):
            measured, first = [], None
            for index, (azimuth, elevation) in enumerate(directions):
                pair = self.pair(azimuth, elevation + np.radians(offset))
                first = first or pair
                measured.append(errors(pair))
                progress(number * cameras + index + 1, len(offsets_deg) * cameras)
            means = np.mean(measured, axis=0).tolist()
            assert first is not None
            yield Row(METHOD, float(offset), *means), first

    def release(self) -> None:
        """Free everything on the GPU."""
        for part in (self._fans, self._meshes, self._impostor, self._truth):
            part.release()


def _check_offsets(offsets_deg: Sequence[float], ring_deg: float) -> None:
    # Beyond the pole a camera comes down again on the other side: nearer to the ring than the offset says.
    for offset in offsets_deg:
        if not abs(ring_deg + offset) <= 90 + 1e-9:
            limits = f"{-90 - ring_deg:.4g} to {90 - ring_deg:.4g}"
            raise SettingsError("offsets_deg", f"{offset:g} degrees from a ring at {ring_deg:.4g}; expected {limits}")


def over_background(pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Premultiplied pixels (H, W, 4) over the comparison's background: (H, W, 3) float32, sRGB, 0 to 1."""
    values = pixels.astype(np.float32) / 255
    return (values[..., :3] + (1 - values[..., 3:]) * np.array(BACKGROUND[:3])).astype(np.float32)


def errors(pair: Pair) -> tuple[float, float, float, float]:
    """PSNR in dB, SSIM, FLIP and silhouette IoU of one pair; see `Row`."""
    truth, shown = over_background(pair.mesh), over_background(pair.impostor)
    solid = pair.mesh[..., 3] >= 128, pair.impostor[..., 3] >= 128
    either = np.count_nonzero(solid[0] | solid[1])
    iou = np.count_nonzero(solid[0] & solid[1]) / either if either else 1.0
    pixels = (pair.mesh[..., 3] > 0) | (pair.impostor[..., 3] > 0)
    if not pixels.any():
        return HIGHEST_PSNR, 1.0, 0.0, 1.0
    square = float(np.mean((truth - shown)[pixels] ** 2))
    psnr = -10 * np.log10(max(square, 10 ** (-HIGHEST_PSNR / 10)))
    window = min(SSIM_WINDOW, min(truth.shape[:2]) - 1 | 1)
    similarity = structural_similarity(truth, shown, channel_axis=2, data_range=1, full=True, win_size=window)[1]
    flip_map = evaluate(truth, shown, "LDR", applyMagma=False)[0]
    return psnr, float(similarity[pixels].mean()), float(flip_map[pixels].mean()), iou


def side_by_side(pairs: Sequence[Pair], gain: float = 4.0) -> NDArray[np.uint8]:
    """A row for each pair: mesh, impostor, difference around grey times `gain`; (rows * S, 3 S, 3) uint8."""
    rows = []
    for pair in pairs:
        truth, shown = over_background(pair.mesh), over_background(pair.impostor)
        rows.append(np.hstack([truth, shown, 0.5 + gain * (shown - truth)]))
    return np.rint(np.clip(np.vstack(rows), 0, 1) * 255).astype(np.uint8)


def as_json(rows: Sequence[Row]) -> dict[str, list[dict[str, object]]]:
    """What `impostor compare --json` prints."""
    return {"rows": [asdict(row) for row in rows]}
