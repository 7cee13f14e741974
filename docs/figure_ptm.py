"""Figures of Polynomial Texture Maps: the dome, photographs against polynomials, lights, normals, a quilted wall."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from bake.direct import LightTriangulation, render_direct
from bake.dome import geodesic_dome
from bake.photographs import Photographs, open_photographs
from bake.ptm import fit_ptm, light_parameters
from docs.studio import INK, PAPER, Studio, captioned, to_bytes
from impostor.files.lp_file import read_lp
from impostor.ptm import Polynomials, evaluate
from impostor.ptm.normals import normals, relight_specular
from impostor.ptm.synthesis import synthesise

CAPTURE = Path(__file__).resolve().parents[1] / "sample_models" / "relief" / "rosette.lp"
BETWEEN = (-0.55, 0.42)  # a light that no photograph has
SMOOTHING = 4  # samples along a pixel's side in drawings


def ptm_dome(studio: Studio) -> Image.Image:
    """The dome of 1998 (its figure 2): lights at the face centres of a once subdivided icosahedron's upper half."""
    side = 420 * SMOOTHING
    drawing = Image.new("RGB", (side, side * 7 // 10), PAPER)
    pen = ImageDraw.Draw(drawing)
    lights = geodesic_dome()
    turn, tilt = np.radians(12), np.radians(24)
    right = np.array([np.cos(turn), np.sin(turn), 0])
    up = np.array([np.sin(turn) * np.sin(tilt), -np.cos(turn) * np.sin(tilt), np.cos(tilt)])

    def at(point: NDArray[np.float64]) -> tuple[float, float]:
        return side / 2 + 0.44 * side * float(point @ right), 0.5 * side - 0.44 * side * float(point @ up)

    spacing = np.linalg.norm(lights[:, None] - lights[None], axis=-1)
    for first, second in np.argwhere(np.triu(spacing < 0.52, 1)):
        pen.line([at(lights[first]), at(lights[second])], INK, SMOOTHING)
    for light in lights:
        pen.line([at(light), at(0.12 * light)], (200, 60, 50), SMOOTHING)
        x, y = at(light)
        pen.ellipse([x - 3 * SMOOTHING, y - 3 * SMOOTHING, x + 3 * SMOOTHING, y + 3 * SMOOTHING], (200, 60, 50))
    return drawing.resize((side // SMOOTHING, side * 7 // 10 // SMOOTHING), Image.Resampling.LANCZOS)


def ptm_direct(studio: Studio) -> Image.Image:
    """Photographs blended at a light between them, three polynomials, one luminance polynomial (figures 3, 5, 6)."""
    photographs, parameters = _capture()
    direct = render_direct(photographs, LightTriangulation(parameters), *BETWEEN)
    pictures = [direct, evaluate(_fit("rgb"), *BETWEEN), evaluate(_fit("lrgb"), *BETWEEN)]
    return captioned(
        [[_shown(picture) for picture in pictures]],
        [["photographs, blended", "three polynomials a texel", "one, times a colour"]],
    )


def ptm_lights(studio: Studio) -> Image.Image:
    """One PTM under four lights (HPL-2004-225, figure 2)."""
    lights = [(-0.75, 0.3), (0.1, 0.8), (0.75, -0.2), (0.0, 0.0)]
    pictures = [_shown(evaluate(_fit("lrgb"), *light)) for light in lights]
    return captioned([pictures], [["from the left", "from above", "from the right", "from the camera"]])


def ptm_normals(studio: Studio) -> Image.Image:
    """What comes out of the coefficients: normals, and a highlight on them that no photograph showed."""
    polynomials = _fit("lrgb")
    found = normals(polynomials)
    toward = (*BETWEEN, (1 - BETWEEN[0] ** 2 - BETWEEN[1] ** 2) ** 0.5)
    shiny = relight_specular(polynomials, found, toward, diffuse=0.6, specular=0.7, exponent=25)
    pictures = [evaluate(polynomials, *BETWEEN), found / 2 + 0.5, shiny]
    return captioned([[_shown(picture) for picture in pictures]], [["as photographed", "normals", "polished"]])


def ptm_photographs(studio: Studio) -> Image.Image | None:
    """A carved lion's head: a photograph that was not fitted, what the others say of it, and what else they show."""
    lp = Path(os.environ.get("IMPOSTOR_DATA", "")) / "rti" / "loewenkopf" / "dirs.lp"
    if not lp.is_file():
        return None
    capture = read_lp(lp)
    lights = capture.directions
    held = int(np.argmax(lights @ (-0.62, 0.42, 0.66)))
    fitted = np.flatnonzero(np.arange(len(lights)) != held)
    photographs = open_photographs([capture.photographs[index] for index in fitted])
    polynomials = fit_ptm(photographs, light_parameters(capture)[fitted])
    found = normals(polynomials)
    toward = lights[held] / np.linalg.norm(lights[held])
    shiny = relight_specular(polynomials, found, tuple(toward), diffuse=0.5, specular=0.6, exponent=20)
    pictures = [
        np.asarray(Image.open(capture.photographs[held]).convert("RGB")) / 255,
        evaluate(polynomials, *toward[:2]),
        evaluate(polynomials, 0.6, -0.2),
        found / 2 + 0.5,
        shiny,
    ]
    captions = ["a photograph, not fitted", "fitted to the other 239", "from the right", "normals", "polished"]
    return captioned([[_shown(picture, 4) for picture in pictures]], [captions])


def ptm_quilt(studio: Studio) -> Image.Image:
    """A surface quilted out of a sample so that it repeats without a seam, under two lights."""
    small = _hammered()
    wall = synthesise(small, (256, 192), patch=40, seed=2)
    lights = [(-0.6, 0.3), (0.6, 0.3)]
    pictures = [Image.fromarray(to_bytes(np.tile(evaluate(wall, *light), (1, 2, 1)))) for light in lights]
    return captioned([pictures], [["twice side by side, light from the left", "the same, light from the right"]])


@cache
def _capture() -> tuple[Photographs, NDArray[np.float64]]:
    capture = read_lp(CAPTURE)
    return open_photographs(capture.photographs), light_parameters(capture)


@cache
def _fit(kind: str) -> Polynomials:
    photographs, parameters = _capture()
    return fit_ptm(photographs, parameters, format=kind)


def _shown(picture: NDArray[np.floating], times: int = 2) -> Image.Image:
    image = Image.fromarray(to_bytes(picture))
    return image.resize((image.width * times, image.height * times), Image.Resampling.BICUBIC)


def _hammered() -> Polynomials:
    """A sheet of hammered copper, as a dome photographs it."""
    from scipy.ndimage import gaussian_filter

    from bake.design import make_design

    random = np.random.default_rng(5)
    heights = gaussian_filter(random.standard_normal((192, 192)), 5, mode="wrap") * 30
    slope_down, slope_right = np.gradient(heights)
    normal = np.stack([-slope_right, slope_down, np.ones_like(heights)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    lights = geodesic_dome()
    shades = np.clip(normal @ lights.T, 0, 1) ** (1 / 2.2)
    design = make_design(lights[:, :2])
    coefficients = shades @ np.linalg.pinv(design.matrix).T
    color = np.broadcast_to(np.array([0.95, 0.62, 0.42], np.float32), (*heights.shape, 3))
    return Polynomials(coefficients[:, :, None].astype(np.float32), color.copy())
