"""Reads a fan and writes one lit picture of it with its shadow; prints how long each step took, as JSON."""

from __future__ import annotations

import time

started = time.perf_counter()

import json  # noqa: E402
import sys  # noqa: E402


def main(fan_path: str, png_path: str) -> None:
    """Time import, reading, context, upload, and drawing until the file is written."""
    steps, last = {}, started

    def done(step: str) -> None:
        nonlocal last
        now = time.perf_counter()
        steps[step], last = now - last, now

    import numpy as np

    from impostor import Ground, load
    from impostor.files.pictures import save_png
    from runtime import ImpostorRenderer
    from runtime.gl.context import make_context
    from runtime.gl.offscreen import Offscreen
    from runtime.viewing.cameras import Camera

    done("import")
    fan = load(fan_path)
    done("read")
    ctx = make_context()
    picture, renderer = Offscreen(ctx, 1280, 720), ImpostorRenderer(ctx)
    ctx.finish()
    done("context")
    renderer.add(fan)
    ctx.finish()
    done("upload")
    middle, radius = fan.views.center.mean(axis=0), float(fan.views.radius.max())
    camera = Camera.perspective(middle + [0, radius, 5 * radius], middle, 30, 1280 / 720, radius / 10, 20 * radius)
    matrices = camera.clip_from_view, camera.view_from_world
    picture.clear((0.4, 0.5, 0.6, 1.0))
    renderer.draw_shadows(*matrices, Ground(np.array([0.0, 1.0, 0.0]), float(middle[1] - radius)))
    renderer.draw(*matrices)
    pixels = picture.color()
    done("draw")
    save_png(png_path, pixels, force=True)
    done("save")
    print(json.dumps(steps))


if __name__ == "__main__":
    main(*sys.argv[1:])
