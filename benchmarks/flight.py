"""Table "flight": the forest's camera path, and what views and levels of detail that switch change in its pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from copy import deepcopy
from dataclasses import dataclass, field, replace
from unittest.mock import patch

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.chart import line_chart
from benchmarks.fresh_process import ROOT
from benchmarks.tables import Bar, Row, Table
from benchmarks.workbench import Workbench, say
from impostor.scene import Placement, Scene
from runtime.fans import impostor_pass, relighting
from runtime.fans.batch import Batch
from runtime.fans.lod import LevelOfDetail, Levels
from runtime.instances.instances import Instances
from runtime.instances.quads import Quads, nearest_views
from runtime.instances.view_fades import VIEW_FADE_SECONDS, ViewFades
from runtime.shadows import strips
from runtime.stage.baking import Bakery, unbaked
from runtime.viewing.viewer import Viewer
from runtime.walk.cli import ready_scene
from runtime.walk.walk import Walk

SCENE = ROOT / "scenes" / "forest.toml"
SIZE = 640, 352
BLOCK = 16  # pixels
FPS = 30
KINDS = ("views", "tiles", "shadows", "levels")
"""What can switch: a copy's view, the mip level of its tile, the views that cast its shadow, and fan or mesh."""
LIMIT = 32.0  # of 255, of a block: what a switch may change
STRETCH = 6.5, 90  # seconds along the path, and frames from there: past the house, where switches show most
MESH_FRAMES = 20
LARGE = 24  # pixels; a copy that switches is looked at alone from that size on

Picture = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Seen:
    """What is to be known of a frame, to draw the next one as if nothing had switched.

    Parameters
    ----------
    viewer : Viewer
    toward_light : tuple of float
        Of the first light.
    shares : list of ndarray
        The fan's share of each copy of each fan that has a mesh.
    fades : list of ViewFades
        Of each fan.
    """

    viewer: Viewer
    toward_light: tuple[float, float, float]
    shares: list[NDArray[np.float32]]
    fades: list[ViewFades]


@dataclass(frozen=True)
class Frame:
    """What changes from one frame to the next, in 0..255 on the sRGB curve.

    Parameters
    ----------
    change, motion, pop : ndarray, (H, W) float64
        Mean absolute differences of blocks of pixels: from the last frame, from there to this one with every switch
        held back, and from that to this one.
    switches : dict of int
        How many copies switched, by kind.
    copies : ndarray, (N, 2) float64
        Pop and motion in the rectangles of large copies whose view switches.
    """

    change: NDArray[np.float64]
    motion: NDArray[np.float64]
    pop: NDArray[np.float64]
    switches: dict[str, int]
    copies: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))


class Flight:
    """A walk along a scene's camera path that can draw a frame a second time, as if nothing had switched in it.

    Parameters
    ----------
    ctx : moderngl.Context
    scene : Scene
    levels : LevelOfDetail, optional
        Of what the scene draws as a mesh where it is near.
    view_fade_seconds : float
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        scene: Scene,
        levels: LevelOfDetail | None = None,
        view_fade_seconds: float = VIEW_FADE_SECONDS,
    ):
        self.walk = Walk(ctx, scene, SIZE)
        self.renderer = self.walk.stage.renderer
        self.renderer._impostors.view_fade_seconds = view_fade_seconds
        for each in self._levels:
            each.settings = levels or LevelOfDetail()
        self.walk.follow_path()

    @property
    def _levels(self) -> list[Levels]:
        return [batch.levels for batch in self._batches if batch.levels is not None]

    @property
    def _batches(self) -> list[Batch]:
        return self.renderer._placed.batches

    def picture(self) -> Picture:
        """Draw a frame from scratch, although nothing may have moved."""
        self.renderer._impostors._frame = None
        self.renderer._shadows.mark_anew()
        self.walk.draw()
        return self.walk.picture().copy()

    def seen(self) -> Seen:
        """Of the frame that was drawn last."""
        viewer = Viewer.from_matrices(*self.walk.camera.matrices, (0, 0, *SIZE))
        shares, fades = [each.fan_share.copy() for each in self._levels], [batch.fades for batch in self._batches]
        return Seen(viewer, self.walk.sun.lighting.lights[0].toward, shares, deepcopy(fades))

    def held(self, before: Seen, kinds: Sequence[str] = KINDS) -> Picture:
        """The frame that was drawn last with some kinds of switches undone; what was lit stays as it is lit."""
        shares, fades = [each.fan_share for each in self._levels], [batch.fades for batch in self._batches]
        with switches_held(before, self.seen(), kinds):
            for each, share in zip(self._levels, before.shares, strict=True):
                each.fan_share = share if "levels" in kinds else each.fan_share
            for batch, fade in zip(self._batches, before.fades, strict=True):
                batch.fades = deepcopy(fade if "views" in kinds else batch.fades)
            picture = self.picture()
        for each, share in zip(self._levels, shares, strict=True):
            each.fan_share = share
        for batch, fade in zip(self._batches, fades, strict=True):
            batch.fades = fade
        return picture

    def skip(self, seconds: float) -> None:
        """Go on along the path without drawing."""
        self.walk.step(seconds)
        self.renderer.advance(np.inf)

    def frames(self, count: int, kinds: Sequence[str] = KINDS) -> Iterator[tuple[Frame, Picture, Picture, Picture]]:
        """Fly on; of each frame what changed, and the pictures before, held back and of now."""
        last, before = self.picture(), self.seen()
        for _ in range(count):
            self.walk.step(1 / FPS)
            now, seen = self.picture(), self.seen()
            held = self.held(before, kinds) if kinds else now
            yield self._frame(last, held, now, before, seen), last, held, now
            last, before = now, seen

    def _frame(self, last: Picture, held: Picture, now: Picture, before: Seen, seen: Seen) -> Frame:
        change, motion, pop = (difference(*pair) for pair in ((last, now), (last, held), (held, now)))
        switches, rectangles = self._switches(before, seen)
        copies = np.stack([means(each, rectangles) for each in (pop, motion)], axis=-1)
        return Frame(blocks(change), blocks(motion), blocks(pop), switches, copies)

    def _switches(self, before: Seen, seen: Seen) -> tuple[dict[str, int], NDArray[np.intp]]:
        """How many copies have switched, and where (N, 4) those stand whose views did: left, top, right, bottom."""
        found: dict[str, int] = dict.fromkeys(KINDS, 0)
        rectangles = []
        for batch in self._batches:
            instances = batch.instances
            now = batch.seen_by(seen.viewer)
            then = _with_view(instances, now, before.viewer.eye)
            switched = np.flatnonzero(now.view != then.view)
            found["views"] += len(switched)
            levels = (impostor_pass._levels(batch, *each) for each in ((then, before.viewer), (now, seen.viewer)))
            found["tiles"] += int(np.count_nonzero(np.not_equal(*levels)))
            lit = (np.append(each.toward_light, 0.0) for each in (before, seen))
            cast = [nearest_views(instances, each, now.index) for each in lit]
            found["shadows"] += int(np.count_nonzero(np.not_equal(*cast)))
            rectangles.append(_rectangles(instances, now.take(switched), seen.viewer))
        for then, now in zip(before.shares, seen.shares, strict=True):
            found["levels"] += int(np.count_nonzero(then != now))
        return found, np.concatenate(rectangles)

    def release(self) -> None:
        """Free everything on the GPU."""
        self.walk.release()


@contextmanager
def switches_held(before: Seen, now: Seen, kinds: Sequence[str]) -> Iterator[None]:
    """Views, tiles' mip levels and shadows' views are chosen as for an earlier frame, and nothing known is relit."""
    eye = before.viewer.eye
    turned = np.append(np.subtract(before.toward_light, now.toward_light), 0.0)
    levels_of, seen_by, quads_toward = impostor_pass._levels, Batch.seen_by, strips.quads_toward

    def seen(batch: Batch, viewer: Viewer) -> Quads:
        quads, fades = seen_by(batch, viewer), batch.fades
        known = fades._seen.take(quads.index) == fades._frame
        return replace(quads, view=np.where(known, fades.shown.take(quads.index), quads.view))

    def quads(instances: Instances, _eye: NDArray[np.float64], viewer: Viewer | None = None) -> Quads:
        return _with_view(instances, quads_toward(instances, _eye, viewer), eye)

    def levels(batch: Batch, quads: Quads, viewer: Viewer) -> NDArray[np.intp]:
        in_front = before.viewer.pixels_per_metre(quads.middle) > 0
        return np.where(in_front, levels_of(batch, quads, before.viewer), levels_of(batch, quads, viewer))

    with ExitStack() as stack:
        hold: Callable[..., object] = lambda *arguments: stack.enter_context(patch.object(*arguments))  # noqa: E731
        if "views" in kinds:
            hold(Batch, "seen_by", seen)
        if "shadows" in kinds:
            hold(strips, "quads_toward", quads)
            hold(strips, "nearest_views", lambda fan, toward, index: nearest_views(fan, toward + turned, index))
        if "tiles" in kinds:
            hold(impostor_pass, "_levels", levels)
        hold(relighting, "TEXELS_A_FRAME", 0)
        hold(relighting, "LARGEST_ERROR", 1e9)
        yield


def _with_view(instances: Instances, quads: Quads, eye: NDArray[np.float64]) -> Quads:
    """The same copies with the views nearest to another eye."""
    return replace(quads, view=nearest_views(instances, eye, quads.index))


def _rectangles(instances: Instances, quads: Quads, viewer: Viewer) -> NDArray[np.intp]:
    """What of the picture (N, 4) large copies reach, row 0 at the top."""
    clip = np.column_stack([quads.origin, np.ones(len(quads))]) @ viewer.clip_from_world.T
    reach = viewer.pixels_per_metre(quads.origin) * np.ptp(instances.fan.bounds, axis=0).max() / 2 * quads.scale
    at = (clip[:, :2] / np.maximum(clip[:, 3:], 1e-9) * (1, -1) + 1) / 2 * SIZE
    corners = np.hstack([at - reach[:, None], at + reach[:, None]])
    corners = np.clip(np.rint(corners), 0, np.tile(SIZE, 2)).astype(np.intp)
    return corners[((corners[:, 2:] - corners[:, :2]) >= LARGE).all(axis=1)]


def run(bench: Workbench) -> Table:
    """Fly the whole path as the scene is shipped, and its busiest stretch in other ways."""
    scene = ready_scene(SCENE)
    fans, meshes = _with_lod(scene, False), _with_lod(scene, True)
    columns = {
        "frames": "frames",
        "views": "views switched",
        "tiles": "tiles' mip levels",
        "shadows": "views that cast",
        "levels": "fading to or from meshes",
        "pop_max": "largest pop",
        "pop_99": "99 %",
        "rise_max": "largest rise",
        "rise_99": "99 % of rises",
        "spike_max": "largest spike",
        "spike_99": "99 % of spikes",
        "change_max": "largest change of a frame",
        "change_99": "99 % of changes",
        "motion_max": "without switches",
        "motion_99": "99 % without",
    }
    table = Table("flight", "A flight through the forest: what switches change", columns)
    # A picture of 720 lines has the house as a mesh from 256 pixels on.
    near, cut = LevelOfDetail(mesh_above_px=128), LevelOfDetail(mesh_above_px=128, fade_seconds=0)
    whole = flown(Flight(bench.ctx, scene, near), 0.0, round(18 * FPS) - 1)
    start, count = STRETCH
    first = round(start * FPS)
    rows: list[tuple[str, str, Callable[[], list[Frame]]]] = [
        ("shipped", "it is shipped: the house a mesh when near", lambda: whole),
        ("stretch", f"{count / FPS:g} s of that", lambda: whole[first : first + count]),
        ("fans", "all fans", lambda: flown(Flight(bench.ctx, fans), *STRETCH)),
        *(
            (kind, f"of that {label}", lambda kind=kind: flown(Flight(bench.ctx, fans), *STRETCH, (kind,)))
            for kind, label in (("views", "views alone"), ("tiles", "mip levels alone"), ("shadows", "shadows alone"))
        ),
        (
            "hard",
            "all fans, views switched at once",
            lambda: flown(Flight(bench.ctx, fans, view_fade_seconds=0), *STRETCH),
        ),
        ("192", "all fans, of 192 views", lambda: flown(Flight(bench.ctx, _with_views(bench, fans, 192)), *STRETCH)),
        ("near 128", "all meshes above 128 px", lambda: flown(Flight(bench.ctx, meshes, near), *STRETCH)),
        ("cut 128", "that without crossfade", lambda: flown(Flight(bench.ctx, meshes, cut), *STRETCH)),
        ("meshes", "nothing but meshes", lambda: flown(Flight(bench.ctx, meshes, MESHES), start, MESH_FRAMES, ())),
    ]
    for key, label, fly in rows:
        say(f"flight: {label}")
        bars = (Bar("pop_max", "<=", LIMIT),) if key in ("shipped", "near 128") else ()
        table.rows.append(Row(key, label, _values(fly()), bars))
    table.chart = _chart(whole)
    width, height = SIZE
    table.notes.append(
        f"scenes/forest.toml at {FPS} frames a second, {width} x {height} pixels, one sample each; the sun moves on by "
        "0.1 degrees in every frame. Every frame is drawn twice: as it is, and with every copy's view, mip level, "
        "share of mesh and casting views as they were in the frame before. What lies between these two pictures is "
        "the pop, and what lies between the frame before and the held one is motion. All numbers are mean absolute "
        f"differences, 0 to 255 on the sRGB curve, of the block of {BLOCK} x {BLOCK} pixels where they are largest; "
        "the rise is by how much a block's change exceeds that by motion, the spike by how much it exceeds the "
        "changes of the same block just before and just after; 99 % are over the frames. Longest side "
        "on screen: 128 px here is 262 px of a picture 720 high."
    )
    return table


MESHES = LevelOfDetail(mesh_above_px=0.0)


def flown(flight: Flight, start: float, count: int, kinds: Sequence[str] = KINDS) -> list[Frame]:
    """Some frames of a flight, from so many seconds along its path; the flight is over then."""
    try:
        if start:
            flight.skip(start)
        return [frame for frame, *_ in flight.frames(count, kinds)]
    finally:
        flight.release()


def _with_lod(scene: Scene, lod: bool) -> Scene:
    """The scene with everything, or nothing, a mesh where it is near."""
    return replace(scene, instances=tuple(replace(each, lod=lod) for each in scene.instances))


def _with_views(bench: Workbench, scene: Scene, views: int) -> Scene:
    """The scene with fans of another number of views, baked for it."""

    def exchanged(placement: Placement) -> Placement:
        subject = placement.subject
        assert subject.bake is not None and subject.model is not None
        fan = bench.folder / f"{subject.model.stem}-{views}.fan"
        return replace(placement, subject=replace(subject, fan=fan, bake=replace(subject.bake, views=views)))

    scene = replace(scene, instances=tuple(exchanged(each) for each in scene.instances))
    Bakery(unbaked(scene)).poll(wait=True)
    return scene


def _values(frames: Sequence[Frame]) -> dict[str, float | None]:
    found: dict[str, float | None] = {"frames": len(frames)}
    found |= {kind: sum(frame.switches[kind] for frame in frames) for kind in KINDS}
    largest = {name: [getattr(frame, name).max() for frame in frames] for name in ("pop", "change", "motion")}
    largest["rise"] = [float((frame.change - frame.motion).max()) for frame in frames]
    changes = np.array([frame.change for frame in frames])
    spikes = changes[1:-1] - np.maximum(changes[:-2], changes[2:])
    largest["spike"] = spikes.max(axis=(1, 2)).tolist()
    for name, values in largest.items():
        found |= {f"{name}_max": float(np.max(values)), f"{name}_99": float(np.percentile(values, 99))}
    return found


def _chart(frames: Sequence[Frame]) -> Image.Image:
    series = {
        label: [((number + 1) / FPS, float(getattr(frame, name).max())) for number, frame in enumerate(frames)]
        for name, label in (("change", "frame to frame"), ("motion", "without switches"), ("pop", "switches alone"))
    }
    y_label = f"largest change of a block of {BLOCK} x {BLOCK} pixels, of 255"
    return line_chart(series, "seconds along the path", y_label, "The forest as it is shipped", linear=True)


def difference(one: Picture, other: Picture) -> NDArray[np.float64]:
    """Mean absolute difference (H, W) of the channels."""
    return np.abs(one.astype(np.int16) - other).mean(axis=-1)


def blocks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means of blocks of pixels."""
    height, width = values.shape
    return values.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK).mean(axis=(1, 3))


def means(values: NDArray[np.float64], rectangles: NDArray[np.intp]) -> NDArray[np.float64]:
    """Mean (N,) of each rectangle."""
    total = np.pad(values.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    left, top, right, bottom = rectangles.T
    whole = total[bottom, right] - total[top, right] - total[bottom, left] + total[top, left]
    return whole / ((right - left) * (bottom - top))
