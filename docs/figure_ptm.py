"""Figures of Polynomial Texture Maps: the dome, photographs against polynomials, lights, normals, a quilted wall."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from bake.design import make_design
from bake.direct import LightTriangulation, render_direct
from bake.dome import geodesic_dome
from bake.photographs import Photographs, open_photographs
from bake.ptm import fit_ptm, light_parameters
from bake.synthetic_capture import Relief, photograph
from docs.studio import INK, PAPER, Studio, captioned, font, to_bytes
from impostor.files.lp_file import read_lp
from impostor.files.ptm_file import read_ptm
from impostor.ptm import Polynomials, evaluate
from impostor.ptm.normals import normals, relight_specular
from impostor.ptm.synthesis import synthesise
from impostor.srgb import srgb_from_linear

CAPTURE = Path(__file__).resolve().parents[1] / "sample_models" / "relief" / "rosette.lp"
BETWEEN = (-0.55, 0.42)  # a light that no photograph has
FOUR_LIGHTS = {
    "from the left": (-0.75, 0.3),
    "from above": (0.1, 0.8),
    "from the right": (0.75, -0.2),
    "from below": (-0.1, -0.75),
}
RTI = Path(os.environ.get("IMPOSTOR_DATA", "")) / "rti"  # real captures, on no account copied into the project
NEWS = "polynomial texture maps light of the from under every lamp a relief answers to"
BICUBIC = Image.Resampling.BICUBIC
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
    """Figures 3, 5 and 6 of 1998: photographs blended; against three polynomials; those against one of luma."""
    return _direct(*_capture(), BETWEEN)


def ptm_direct_photographs(studio: Studio) -> Image.Image | None:
    """The same of a carved lion's head."""
    return None if (capture := _lion()) is None else _direct(*capture, BETWEEN, times=6)


def ptm_lights(studio: Studio) -> Image.Image:
    """Two PTMs under four lights each (HPL-2004-225, figure 2)."""
    return _under_lights([_fit("lrgb"), _newspaper()], 256)


def ptm_lights_photographs(studio: Studio) -> Image.Image | None:
    """The same of a clay tablet, in a file of HP's own tools, and of a carved lion's head."""
    tablet = RTI / "tablet1.ptm"
    if (capture := _lion()) is None or not tablet.is_file():
        return None
    return _under_lights([read_ptm(tablet).polynomials(), fit_ptm(*capture)], 384)


def ptm_normals(studio: Studio) -> Image.Image:
    """What comes out of the coefficients: normals, and a highlight on them that no photograph showed."""
    polynomials = _fit("lrgb")
    found = normals(polynomials)
    shiny = relight_specular(polynomials, found, _toward(*BETWEEN), diffuse=0.6, specular=0.7, exponent=25)
    pictures = [evaluate(polynomials, *BETWEEN), found / 2 + 0.5, shiny]
    return captioned([[_shown(picture) for picture in pictures]], [["as photographed", "normals", "polished"]])


def ptm_photographs(studio: Studio) -> Image.Image | None:
    """A carved lion's head: a photograph that was not fitted, what the others say of it, and what else they show."""
    if (capture := _lion()) is None:
        return None
    photographs, parameters = capture
    held = int(np.argmin(np.linalg.norm(parameters - (-0.62, 0.42), axis=1)))
    fitted = np.flatnonzero(np.arange(len(photographs)) != held)
    polynomials = fit_ptm(open_photographs([photographs.paths[index] for index in fitted]), parameters[fitted])
    found, light = normals(polynomials), parameters[held]
    shiny = relight_specular(polynomials, found, _toward(*light), diffuse=0.5, specular=0.6, exponent=20)
    pictures = [
        photographs.decode(held) / photographs.white,
        evaluate(polynomials, *light),
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


def _lion() -> tuple[Photographs, NDArray[np.float64]] | None:
    """240 photographs of a carved lion's head, where they are at hand."""
    lp = RTI / "loewenkopf" / "dirs.lp"
    if not lp.is_file():
        return None
    capture = read_lp(lp)
    return open_photographs(capture.photographs), light_parameters(capture)


def _direct(
    photographs: Photographs, parameters: NDArray[np.float64], light: tuple[float, float], times: int = 2
) -> Image.Image:
    """Photographs blended; half above half with three polynomials a texel; half above half of those and one of luma."""
    blended = render_direct(photographs, LightTriangulation(parameters), *light)
    three, luma = (evaluate(fit_ptm(photographs, parameters, format=kind), *light) for kind in ("rgb", "lum"))
    pictures = [blended, _halves(blended, three), _halves(three, luma)]
    captions = ["3: photographs, blended", "5: photographs / 3 polynomials", "6: 3 polynomials / 1 of luma"]
    return captioned([[_shown(picture, times) for picture in pictures]], [captions])


def _halves(above: NDArray[np.floating], below: NDArray[np.floating]) -> NDArray[np.floating]:
    middle = len(above) // 2
    return np.concatenate([above[:middle], below[middle:]])


def _under_lights(surfaces: Sequence[Polynomials], width: int) -> Image.Image:
    """A row of pictures each, `width` pixels wide, under the same four lights."""
    rows = []
    for surface in surfaces:
        size = width, width * surface.size[1] // surface.size[0]
        pictures = (to_bytes(evaluate(surface, *light)) for light in FOUR_LIGHTS.values())
        rows.append([Image.fromarray(picture).resize(size, BICUBIC) for picture in pictures])
    return captioned(rows, [[""] * 4] * (len(rows) - 1) + [list(FOUR_LIGHTS)])


def _toward(lu: float, lv: float) -> tuple[float, float, float]:
    """The unit vector toward a light."""
    return lu, lv, (1 - lu * lu - lv * lv) ** 0.5


def _shown(picture: NDArray[np.floating], times: int = 2) -> Image.Image:
    image = Image.fromarray(to_bytes(picture))
    return image.resize((image.width * times, image.height * times), BICUBIC)


def _hammered() -> Polynomials:
    """A sheet of hammered copper, as a dome photographs it."""
    from scipy.ndimage import gaussian_filter

    random = np.random.default_rng(5)
    heights = gaussian_filter(random.standard_normal((192, 192)), 5, mode="wrap") * 30
    slope_down, slope_right = np.gradient(heights)
    normal = np.stack([-slope_right, slope_down, np.ones_like(heights)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    coefficients = _fitted(np.clip(normal @ geodesic_dome().T, 0, 1) ** (1 / 2.2))
    color = np.broadcast_to(np.array([0.95, 0.62, 0.42], np.float32), (*heights.shape, 3))
    return Polynomials(coefficients[:, :, None], color.copy())


def _newspaper(side: int = 160) -> Polynomials:
    """A crumpled newspaper, after the one that HPL-98-131 shows: a sheet bent along many lines."""
    from scipy.ndimage import gaussian_filter

    random = np.random.default_rng(3)
    row, column = np.mgrid[:side, :side]
    heights = np.zeros((side, side))
    for _ in range(40):
        across, (x, y) = random.uniform(0, np.pi), random.uniform(0, side, 2)
        heights += random.normal(0, 0.22) * np.abs((column - x) * np.cos(across) + (row - y) * np.sin(across))
    heights = gaussian_filter(heights - gaussian_filter(heights, 14), 0.7)
    paper = np.array([0.67, 0.64, 0.58]) * (0.18 + 0.82 * _print(side, random))[..., None]
    pictures = photograph(Relief(heights, paper), geodesic_dome(), bounce=False)
    return Polynomials(_fitted(np.moveaxis(srgb_from_linear(pictures), 0, -1)))


def _print(side: int, random: np.random.Generator) -> NDArray[np.float64]:
    """A page of a newspaper, (side, side): 1 is paper, 0 is ink."""
    big, columns, lines = 4 * side, 3, 26
    page = Image.new("L", (big, big), 255)
    pen = ImageDraw.Draw(page)
    pen.text((big / 2, 8), "THE DAILY TEXEL", 0, font(54), anchor="ma")
    for number in range(columns):
        column = Image.new("L", (big // columns - 20, big), 255)
        for line in range(lines):
            ImageDraw.Draw(column).text((0, 21 * line), " ".join(random.choice(NEWS.split(), 6)), 40, font(17))
        page.paste(column, (10 + number * big // columns, 84))
    return np.asarray(page.resize((side, side), Image.Resampling.LANCZOS)) / 255


def _fitted(samples: NDArray[np.floating]) -> NDArray[np.float32]:
    """Coefficients (..., 6) of samples (..., N) under the geodesic dome's lights."""
    return (samples @ np.linalg.pinv(make_design(geodesic_dome()[:, :2]).matrix).T).astype(np.float32)
