"""Table "ptm_peers": fitters side by side, each against plain least squares on the machine that it was measured on."""

from __future__ import annotations

from functools import partial

import numpy as np
from PIL import Image

from bake.design import make_design
from benchmarks.fresh_process import run_fresh
from benchmarks.ptm import HEIGHT, WIDTH, Lit, capture, fit_command, large_set, psnr
from benchmarks.tables import Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import DATA, Workbench, say
from impostor.files.ptm_file import read_ptm
from impostor.ptm import Polynomials

LIGHTS, TEST_LIGHTS = 49, 20
# Seconds, PSNR in dB, planes a texel and megabytes, all measured once and together: 24 synthetic objects of 320 x 320
# tiled to WIDTH x HEIGHT, LIGHTS to fit and TEST_LIGHTS others, on two cores.
LEAST_SQUARES = 1.7, 23.79, 18, None
PEERS = {
    "relight, ptm (C++)": (10.4, 22.42, 18, 3.5),
    "relight, lptm": (7.3, 22.42, 9, 4.1),
    "relight, hsh27": (16.2, 22.96, 27, 5.4),
    "relight, rbf18": (13.4, 24.22, 18, 10.8),
    "relight, bilinear18": (22.1, 25.21, 18, 10.8),
    "PTMGenerator (Python), LRGB": (1.96, 23.73, 9, 22.1),
    "NumPy least squares, RGB, nothing written": LEAST_SQUARES,
}
SLOW = "LRGB, `--robust`"  # timed once
OURS = {
    "LRGB": ("lrgb", 9),
    "LRGB, `--jpeg 95`": ("lrgb", 9, "--jpeg", "95"),
    "RGB": ("rgb", 18),
    "RGB, `--jpeg 95`": ("rgb", 18, "--jpeg", "95"),
    SLOW: ("lrgb", 9, "--robust"),
}


def run(bench: Workbench) -> Table:
    """Time, truth and size of our fits beside those of others."""
    columns = {
        "seconds": "seconds",
        "megapixels": "megapixels of PTM a second",
        "speed": "speed, least squares = 1",
        "psnr_db": "PSNR above least squares, dB",
        "planes": "planes",
        "megabytes": "MB",
    }
    table = Table("ptm_peers", f"Fitters: {LIGHTS} photographs of {WIDTH} x {HEIGHT}", columns)
    for label, measured in PEERS.items():
        table.rows.append(_row(label, measured, LEAST_SQUARES))
    lp = large_set(bench.folder / "peers", LIGHTS)
    test = capture(large_set(bench.folder / "peers_test", TEST_LIGHTS, part="Test"))
    fitted = capture(lp)
    say("ptm_peers: quick ones, in turns")
    outputs = {label: bench.folder / f"peers_{number}.ptm" for number, label in enumerate(OURS)}
    commands = {label: fit_command(lp, outputs[label], kind, *more) for label, (kind, _, *more) in OURS.items()}
    jobs = [partial(run_fresh, commands[label]) for label in OURS if label != SLOW]
    times = alternate(partial(_least_squares, fitted), *jobs, repeats=5, warm_up=1)
    seconds = {
        label: times.median(0) / times.ratio(0, number + 1) for number, label in enumerate(OURS) if label != SLOW
    }
    say(f"ptm_peers: {SLOW}")
    seconds[SLOW] = run_fresh(commands[SLOW]).seconds
    base = times.median(0), psnr(_least_squares(fitted), test), 18, None
    table.rows.append(_row("NumPy least squares, RGB, beside ours", base, base))
    for label, (_, planes, *_) in OURS.items():
        path = outputs[label]
        found = seconds[label], psnr(read_ptm(path).polynomials(), test), planes, path.stat().st_size / 1e6
        table.rows.append(_row(f"`impostor ptm fit`, {label}", found, base))
    objects = "three of these objects" if (DATA / "rti" / "synthrti").is_dir() else "the sample capture, none held out"
    table.notes.append(
        f"The others, and plain least squares beside them, were measured once, on another day, on two cores: 24 "
        f"synthetic objects tiled to this size, {LIGHTS} lights to fit, {TEST_LIGHTS} others for the PSNR of stored "
        f"(sRGB) values. Ours are measured with {objects}, as whole commands from start to the file on "
        f"disk, in turns with a least squares written anew: decode all, then one matrix product. relight fits light "
        f"unless told to fit stored values; its ptm is then 0.13 dB below least squares."
    )
    return table


def _row(label: str, measured: tuple[float, float, int, float | None], base: tuple[float, float, int, None]) -> Row:
    seconds, decibels, planes, megabytes = measured
    values = {
        "seconds": seconds,
        "megapixels": WIDTH * HEIGHT / 1e6 / seconds,
        "speed": base[0] / seconds,
        "psnr_db": decibels - base[1],
        "planes": planes,
        "megabytes": megabytes,
    }
    return Row(label, label, values)


def _least_squares(fitted: Lit) -> Polynomials:
    """What anyone would write first: all photographs in memory, and one matrix product."""
    photographs, parameters = fitted
    pictures = np.stack([np.asarray(Image.open(path).convert("RGB")) for path in photographs.paths])
    solver = (np.linalg.pinv(make_design(parameters).matrix) / 255).astype(np.float32)
    coefficients = solver @ pictures.reshape(len(pictures), -1).astype(np.float32)
    return Polynomials(np.moveaxis(coefficients.reshape(-1, *pictures.shape[1:]), 0, -1))
