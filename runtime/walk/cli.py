"""`impostor walk`, and `impostor render` of a scene."""

from __future__ import annotations

import json
import math
import os
import sys
import warnings
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from impostor.commands import AsJson, Force, Quiet, check_name, progress_bar
from impostor.errors import GpuError, SettingsError, ViewWarning
from impostor.stopping import INTERRUPTED

if TYPE_CHECKING:
    import moderngl
    import numpy as np
    from numpy.typing import NDArray

    from impostor.scene import Scene
    from runtime.walk.walk import Walk
    from runtime.walk.window import Window

MAX_SIDE = 16384
MAX_FRAMES = 1_000_000
SMOOTH = 4  # samples a pixel on a GPU; in software they would cost too much
FONT_SIZE = 14
OUTPUTS = {"lit": "lit", "albedo": "albedo", "normal": "normals", "depth": "depth"}


def walk(
    scene_file: Annotated[Path, typer.Argument(metavar="SCENE", help="A .toml scene.")],
    record: Annotated[
        Path | None, typer.Option(metavar="OUT.mp4", help="Film the scene's camera path, without a window.")
    ] = None,
    frames: Annotated[int | None, typer.Option(metavar="N", help="So many pictures, then end.")] = None,
    size: Annotated[str, typer.Option(metavar="WxH")] = "1280x720",
    fps: Annotated[int, typer.Option(metavar="R", help="Pictures a second, of films and of --frames.")] = 30,
    window: Annotated[
        bool | None, typer.Option("--window/--headless", help="In a window; if left out, where there is a display.")
    ] = None,
    picture: Annotated[Path | None, typer.Option(metavar="OUT.png", help="Write the last picture.")] = None,
    free_mouse: Annotated[bool, typer.Option("--free-mouse", help="Leave the mouse alone until Tab.")] = False,
    as_json: AsJson = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Walk through a scene, in a window or without one."""
    pixels = picture_size(size)
    if frames is not None and not 1 <= frames <= MAX_FRAMES:
        raise SettingsError("--frames", f"{frames}; expected 1 to {MAX_FRAMES:,}")
    if not 1 <= fps <= 240:
        raise SettingsError("--fps", f"{fps}; expected 1 to 240")
    if record is not None:
        from impostor.files.video import film_size

        check_name(record, ".mp4", force)
        pixels = film_size(pixels)
    if picture is not None:
        check_name(picture, ".png", force)
    if record is not None and window:
        raise SettingsError("--window", "given with --record; expected one of them")

    scene = ready_scene(scene_file, quiet)
    path = scene.camera.path
    if record is not None and frames is None and path is None:
        raise SettingsError("--record", f"{scene_file} has no camera path; expected one in the scene, or --frames")
    shown = None if record is not None or window is False else _window(scene_file, pixels, not free_mouse, bool(window))
    if shown is not None:
        summary = _walk_in_window(shown, scene_file, scene, frames, fps, picture, force, quiet)
    else:
        if frames is None:
            frames = 1 if path is None else math.floor(path.duration * fps + 1e-6) + 1
        if window is None and record is None and not quiet:
            counted = "1 picture" if frames == 1 else f"{frames} pictures"
            print(f"impostor: no display; drawing {counted} without a window", file=sys.stderr)
        summary = _walk_headless(scene, pixels, frames, fps, record, picture, force, quiet)
    if as_json:
        print(json.dumps(summary, indent=2))
    elif not quiet:
        width, height = summary["size"]
        print(
            f"{scene_file}: {summary['frames']} pictures of {width}x{height}, {summary['frame_ms']:.1f} ms each, "
            f"{summary['draw_calls']} draw calls, {summary['triangles_not_drawn']:,} triangles not drawn"
        )


def render_scene(
    scene_file: Path,
    output_file: Path,
    size: tuple[int, int],
    output: str,
    shadows: bool,
    camera: Mapping[str, Any],
    force: bool,
    quiet: bool = False,
) -> None:
    """Draw what a scene's camera sees first, as a PNG.

    `camera` has other values for `eye`, `target` and `fov_deg`, or None.
    """
    from impostor.files.pictures import save_png
    from runtime.fans.leaning import FARTHEST_OFF_DEG
    from runtime.gl.context import make_context
    from runtime.walk.walk import Walk

    if output not in OUTPUTS:
        raise SettingsError("--output", f"{output!r} of a scene; expected one of {', '.join(OUTPUTS)}")
    check_name(output_file, ".png", force)
    scene = ready_scene(scene_file, quiet)
    given = {name: tuple(value) if isinstance(value, list) else value for name, value in camera.items() if value}
    scene = replace(scene, camera=replace(scene.camera, **given))
    with ExitStack() as stack:
        ctx = make_context()
        stack.callback(ctx.release)
        drawn = Walk(ctx, scene, size, SMOOTH)
        stack.callback(drawn.release)
        drawn.shown.view, drawn.shown.shadows = OUTPUTS[output], shadows
        drawn.draw()
        for name, off in drawn.leaning.items():
            found = f"{scene_file}: {name} is seen from an elevation {off:.3g} degrees away from its views"
            expected = f"expected at most {FARTHEST_OFF_DEG:g}, a fan baked there, or lod = true"
            warnings.warn(ViewWarning(f"{found}; {expected}"), stacklevel=1)
        save_png(output_file, drawn.picture(), force=force)


def picture_size(text: str) -> tuple[int, int]:
    """Width and height of `--size`."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and 1 <= int(width) <= MAX_SIDE and 1 <= int(height) <= MAX_SIDE):
        raise SettingsError("--size", f"{text!r}; expected WIDTHxHEIGHT in pixels, such as 640x480, at most {MAX_SIDE}")
    return int(width), int(height)


def ready_scene(scene_file: Path, quiet: bool = False) -> Scene:
    """A scene; what it is missing is baked."""
    from impostor.files.scene_file import load_scene
    from runtime.stage.baking import Bakery, unbaked

    scene = load_scene(scene_file)
    bakery = Bakery(unbaked(scene), quiet)
    try:
        bakery.poll(wait=True)
    except KeyboardInterrupt:
        bakery.stop()
        sys.exit(INTERRUPTED)  # the bake has said that it was stopped
    if bakery.failed:
        raise typer.Exit(1)  # the bake itself has said why
    return scene


def _window(scene_file: Path, size: tuple[int, int], catch_mouse: bool, forced: bool) -> Window | None:
    """A window, or None where there is no display and none was asked for."""
    if not forced and not _may_have_display():
        return None
    from runtime.walk.window import Window

    try:
        return Window(f"{scene_file.name} - impostor", size, catch_mouse)
    except GpuError:
        if forced:
            raise
        return None


def _walk_in_window(
    window: Window,
    scene_file: Path,
    scene: Scene,
    frames: int | None,
    fps: int,
    picture: Path | None,
    force: bool,
    quiet: bool,
) -> dict[str, Any]:
    from impostor.files.pictures import save_png
    from impostor.files.scene_watcher import SceneWatcher
    from runtime.stage.changes import SceneChanges
    from runtime.walk.walk import Walk

    with ExitStack() as stack:
        stack.callback(window.close)
        samples, font_size = _samples(window.ctx), round(FONT_SIZE * window.pixel_ratio)
        window.announce(f"loading {scene_file.name} ...", font_size)
        changes = SceneChanges(SceneWatcher(scene_file), quiet)
        walk = Walk(window.ctx, scene, window.picture_size, samples, changes, font_size)
        stack.callback(walk.release)
        window.on_picture = lambda: walk.say(_written(scene_file, walk.picture(), quiet))
        if frames is None:
            window.run(walk)
        else:
            walk.follow_path()
            window.run(walk, frames, 1 / fps)
        if picture is not None:
            save_png(picture, walk.picture(), force=force)
        return _summary(walk)


def _written(scene_file: Path, pixels: NDArray[np.uint8], quiet: bool) -> str:
    """Write a picture of a walk into the working directory; what to say of it."""
    from impostor.errors import OutputError
    from impostor.files.pictures import save_png

    number = 1
    while (path := Path(f"{scene_file.stem}-{number:03d}.png")).exists():
        number += 1
    try:
        save_png(path, pixels)
    except OutputError as error:
        return str(error)
    if not quiet:
        print(f"impostor: {path.resolve()} written", file=sys.stderr)
    return f"{path} written"


def _walk_headless(
    scene: Scene,
    size: tuple[int, int],
    frames: int,
    fps: int,
    record: Path | None,
    picture: Path | None,
    force: bool,
    quiet: bool,
) -> dict[str, Any]:
    from impostor.files.pictures import save_png
    from impostor.files.video import video_output
    from runtime.gl.context import make_context
    from runtime.walk.walk import Walk

    with ExitStack() as stack:
        ctx = make_context()
        stack.callback(ctx.release)
        walk = Walk(ctx, scene, size, _samples(ctx))
        stack.callback(walk.release)
        walk.follow_path()
        progress = stack.enter_context(progress_bar("walking", quiet))
        film: Callable[[NDArray[np.uint8]], None] | None = None
        if record is not None:
            film = stack.enter_context(video_output(record, size, fps, force))
        for number in range(frames):
            if number:
                walk.step(1 / fps)
            walk.draw()
            if film is not None:
                film(walk.picture())
            progress(number + 1, frames)
        if picture is not None:
            save_png(picture, walk.picture(), force=force)
        return _summary(walk)


def _summary(walk: Walk) -> dict[str, Any]:
    return {
        "size": list(walk.canvas.size),
        **walk.statistics.summary(),
        "triangles_not_drawn": walk.triangles_not_drawn,
        "memory_bytes": walk.memory,
    }


def _samples(ctx: moderngl.Context) -> int:
    return 1 if "llvmpipe" in ctx.info["GL_RENDERER"] else SMOOTH


def _may_have_display() -> bool:
    """False where it is certain that no window can be opened."""
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY"))
