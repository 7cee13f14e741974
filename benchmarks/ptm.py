"""Tables "ptm" and "ptm_fit": how true PTMs are under lights that were not fitted, and how fast they are fitted."""

from __future__ import annotations

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bake.direct import LightTriangulation, render_direct
from bake.held_out import score
from bake.photographs import Photographs, decoded, open_photographs
from bake.ptm import fit_ptm, light_parameters
from benchmarks.fresh_process import run_fresh
from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import COMMAND, DATA, SAMPLES, Workbench, say
from impostor.files.lp_file import CaptureSet, read_lp, write_lp
from impostor.files.ptm_file import read_ptm, write_ptm
from impostor.ptm import Polynomials, evaluate, quantise
from impostor.ptm.normals import normals
from impostor.srgb import linear_from_srgb

Lit = tuple[Photographs, NDArray[np.float64]]  # photographs, and (lu, lv) of each

SETS = ("Object1/material1", "Object1/material4", "Object2/material2")
WIDTH, HEIGHT = 1920, 1280
STORED: tuple[tuple[str, dict[str, Any], tuple[str, ...]], ...] = (
    ("gray objects", {}, ("lrgb", "rgb")),
    ("in colour", {"color": True}, ("lrgb", "rgb")),
    ("in colour, 4:2:2", {"color": True, "subsampling": 1}, ("lrgb",)),
    ("in colour, 4:4:4", {"color": True, "subsampling": 0}, ("lrgb",)),
    ("in colour, PNG", {"color": True, "suffix": ".png"}, ("lrgb",)),
)
WORKERS = os.cpu_count() or 1


def run_quality(bench: Workbench) -> Table:
    """PSNR under held-out lights, of fits, files and the photographs themselves."""
    columns = {
        "psnr_db": "PSNR, dB",
        "against_lstsq_db": "above NumPy lstsq, dB",
        "file_loss_db": "lost by 8 bits, dB",
        "jpeg_loss_db": "lost by JPEG_LRGB 95, dB",
        "jpeg_smaller": "raw / JPEG_LRGB 95",
        "prediction_saves": "saved by prediction, %",
        "normals_deg": "normals off by, degrees",
        "direct_db": "photographs blended, dB",
        "gloss": "brightest / median light",
    }
    table = Table("ptm", "PTMs under lights that were not fitted", columns)
    folder = DATA / "rti" / "synthrti"
    if not folder.is_dir():
        table.notes.append("No real capture sets here (IMPOSTOR_DATA names their folder).")
        return table
    for name in SETS:
        say(f"ptm: {name}")
        dome, test = (capture(folder / name / part / "dirs.lp") for part in ("Dome", "Test"))
        truth = np.asarray(Image.open(folder / name / "Dome" / "normals.png").convert("RGB"), float) / 127.5 - 1
        plain = {kind: fit_ptm(*dome, format=kind) for kind in ("rgb", "lrgb")}
        robust = fit_ptm(*dome, format="lrgb", robust=True)
        lstsq = psnr(_lstsq(*dome), test)
        off = {"rgb": _off(plain["rgb"], truth), "robust": _off(robust, truth)}
        values = {
            "psnr_db": psnr(plain["rgb"], test),
            "against_lstsq_db": psnr(plain["rgb"], test) - lstsq,
            "normals_deg": off["rgb"],
            "direct_db": direct_psnr(dome, test),
            "gloss": _gloss(dome[0]),
        }
        table.rows.append(Row(f"{name} rgb", f"{name}, RGB", values, (Bar("against_lstsq_db", ">=", -0.005),)))
        values = {"psnr_db": psnr(plain["lrgb"], test), **_files(bench.folder, plain["lrgb"], test)}
        bars = (
            Bar("file_loss_db", "<=", 0.05),
            Bar("jpeg_loss_db", "<=", 0.3),
            Bar("jpeg_smaller", ">=", 4),
            Bar("prediction_saves", ">=", 0),
        )
        table.rows.append(Row(f"{name} lrgb", f"{name}, LRGB", values, bars))
        values = {"psnr_db": psnr(robust, test), "normals_deg": off["robust"]}
        bars = (Bar("normals_deg", "<=", 0.75 * off["rgb"]),)
        table.rows.append(Row(f"{name} robust", f"{name}, LRGB, --robust", values, bars))
    table.notes.append(
        "Synthetic objects of 320 x 320, 49 lights to fit and 20 others to measure with; PSNR of stored (sRGB) "
        "values. The robust fit's bar is three quarters of the plain one's angle, on every set; its PSNR may fall, "
        "because the held-out pictures hold the highlights. Brightest over median light tells how glossy a set is: "
        "linear light of a texel's brightest photograph over that of its median one, the middle texel's; about 2 "
        "is matt under this dome. The metal, Object1/material4, is the glossiest."
    )
    return table


def run_fit(bench: Workbench) -> Table:
    """Time and memory of fits, against decoding the same photographs."""
    columns = {
        "photographs": "photographs",
        "decode_s": "decoding, s",
        "fit_s": "fitting, s",
        "ratio": "fitting / decoding",
        "megapixels": "megapixels a second",
        "peak_gb": "`impostor ptm fit`, peak GB",
    }
    table = Table("ptm_fit", f"Fitting photographs of {WIDTH} x {HEIGHT}", columns)
    for number, (label, settings, kinds) in enumerate(STORED):
        lp = large_set(bench.folder / f"photographs_{number}", 49, **settings)
        photographs, parameters = capture(lp)
        for kind in kinds:
            say(f"ptm_fit: {label}, {kind}")
            jobs = (lambda each=photographs: _decode(each), _fit_job(photographs, parameters, kind))
            times = alternate(*jobs, repeats=5, warm_up=1)
            cost = run_fresh(fit_command(lp, bench.folder / "a.ptm", kind))
            values = {
                "photographs": 49,
                "decode_s": times.median(0),
                "fit_s": times.median(1),
                "ratio": times.ratio(1, 0),
                "megapixels": 49 * WIDTH * HEIGHT / 1e6 / times.median(1),
                "peak_gb": None if cost.peak_bytes is None else cost.peak_bytes / 1e9,
            }
            bars = (Bar("ratio", "<=", 1.6), Bar("peak_gb", "<", 0.6))
            table.rows.append(Row(f"{label} {kind}", f"{label}, {kind.upper()}", values, bars))
    lp = large_set(bench.folder / "photographs_many", 500)
    cost = run_fresh(fit_command(lp, bench.folder / "a.ptm", "lrgb"))
    peak = None if cost.peak_bytes is None else cost.peak_bytes / 1e9
    before = table.rows[0].values["peak_gb"]
    bars = () if before is None else (Bar("peak_gb", "<=", before * 1.05),)
    table.rows.append(Row("500", "gray objects, LRGB", {"photographs": 500, "peak_gb": peak}, bars))
    table.notes.append(
        f"Sets of 320 x 320 tiled to {WIDTH} x {HEIGHT}, JPEGs with colour at half size (4:2:0) unless it says "
        f"otherwise; {WORKERS} threads for both. Decoding gives NumPy arrays, as the fit needs them; fitting does "
        "that, too. Peak memory is the command's, in a fresh process."
    )
    return table


def capture(lp: Path) -> Lit:
    """The photographs that an `.lp` file names, and their lights."""
    found = read_lp(lp)
    return open_photographs(found.photographs), light_parameters(found)


def psnr(polynomials: Polynomials, test: Lit) -> float:
    """Of a fit, against photographs it was not given."""
    return score(lambda u, v: evaluate(polynomials, u, v), polynomials.size, *test, WORKERS).psnr_db


def direct_psnr(dome: Lit, test: Lit) -> float:
    """Of the photographs themselves, blended, against others."""
    photographs, triangulation = dome[0], LightTriangulation(dome[1])
    return score(lambda u, v: render_direct(photographs, triangulation, u, v), photographs.size, *test, WORKERS).psnr_db


def _lstsq(photographs: Photographs, parameters: NDArray[np.float64]) -> Polynomials:
    u, v = parameters.T
    matrix = np.stack([u * u, v * v, u * v, u, v, np.ones_like(u)], axis=-1)
    pictures = np.stack([np.asarray(Image.open(path).convert("RGB")) / 255 for path in photographs.paths])
    found = np.linalg.lstsq(matrix, pictures.reshape(len(pictures), -1), rcond=None)[0]
    shape = (6, *pictures.shape[1:])
    return Polynomials(np.moveaxis(found.reshape(shape), 0, -1).astype(np.float32))


def _gloss(photographs: Photographs) -> float:
    """Linear light of the brightest photograph over that of the median one, the middle texel's."""
    pictures = np.stack([np.asarray(Image.open(path).convert("L")) / 255 for path in photographs.paths])
    light = linear_from_srgb(pictures)
    most, middle = light.max(axis=0), np.median(light, axis=0)
    lit = most > 0.02
    return float(np.median(most[lit] / np.maximum(middle[lit], 1e-3)))


def _off(polynomials: Polynomials, truth: NDArray[np.float64]) -> float:
    length = np.linalg.norm(truth, axis=-1)
    known = np.abs(length - 1) < 0.1
    cosine = np.einsum("hwc,hwc->hw", normals(polynomials), truth) / np.maximum(length, 1e-9)
    return float(np.degrees(np.arccos(np.clip(cosine[known], -1, 1))).mean())


def _files(folder: Path, polynomials: Polynomials, test: Lit) -> dict[str, float]:
    ptm, path = quantise(polynomials), folder / "a.ptm"
    raw = write_ptm(ptm, path, force=True)
    whole, stored = psnr(polynomials, test), psnr(read_ptm(path).polynomials(), test)
    bare = write_ptm(ptm, path, compression="jpeg", quality=95, predict=False, force=True)
    small = write_ptm(ptm, path, compression="jpeg", quality=95, force=True)
    return {
        "file_loss_db": whole - stored,
        "jpeg_loss_db": stored - psnr(read_ptm(path).polynomials(), test),
        "jpeg_smaller": raw / small,
        "prediction_saves": 100 * (1 - small / bare),
    }


def large_set(
    folder: Path, count: int, color: bool = False, part: str = "Dome", suffix: str = ".jpg", **save: Any
) -> Path:
    """Photographs of WIDTH x HEIGHT: the real sets tiled, or the sample set where they are not at hand."""
    folder.mkdir(exist_ok=True)
    real = DATA / "rti" / "synthrti"
    files = [real / name / part / "dirs.lp" for name in SETS] if real.is_dir() else []
    sources = [read_lp(path) for path in files or [SAMPLES / "relief" / "rosette.lp"]]
    tint = np.array([1.0, 0.8, 0.6]) if color else np.ones(3)
    paths = []
    for index in range(count):
        tiles = [Image.open(each.photographs[index % len(each.photographs)]).convert("RGB") for each in sources]
        picture = Image.new("RGB", (WIDTH, HEIGHT))
        side = tiles[0].width
        for place in range(-(-WIDTH // side) * -(-HEIGHT // side)):
            row, column = divmod(place, -(-WIDTH // side))
            picture.paste(tiles[place % len(tiles)], (column * side, row * side))
        pixels = Image.fromarray(np.rint(np.asarray(picture) * tint).astype(np.uint8))
        paths.append(folder / f"{index:03d}{suffix}")
        pixels.save(paths[-1], quality=92, **save)
    directions = sources[0].directions[np.arange(count) % len(sources[0].directions)]
    write_lp(
        replace(cast(CaptureSet, sources[0]), photographs=tuple(paths), directions=directions), folder / "a.lp", True
    )
    return folder / "a.lp"


def _decode(photographs: Photographs) -> None:
    with ThreadPoolExecutor(WORKERS) as pool:
        for _ in decoded(photographs, pool, 16):
            pass


def _fit_job(photographs: Photographs, parameters: NDArray[np.float64], kind: str):
    return lambda: fit_ptm(photographs, parameters, format=kind, workers=WORKERS)


def fit_command(lp: Path, output: Path, kind: str, *more: str) -> list[str]:
    """`impostor ptm fit`, to be run in a process of its own."""
    command = [sys.executable, str(COMMAND), "ptm", "fit", str(lp), "-o", str(output)]
    return [*command, "--format", kind, *more, "--force", "--quiet"]
