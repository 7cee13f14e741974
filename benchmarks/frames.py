"""Tables "frames" and "fill": objects as impostors against the same objects as meshes, and as plain textured quads."""

from __future__ import annotations

import math

from benchmarks.plain_quads import BILINEAR, TRILINEAR, PlainQuads
from benchmarks.scenes import HEIGHT, HEIGHTS, WIDTH, Field, MeshField
from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import Times, alternate
from benchmarks.workbench import Workbench, say

LONGEST_FRAME = 60.0  # seconds; of a longer one a part is drawn and the rest estimated
SPEED_UPS = {1: 10.0, 100: 200.0}
SCENE = f"{WIDTH} x {HEIGHT} pixels; `objects` copies over the whole picture, each turned another way"


def run_frames(bench: Workbench) -> Table:
    """Frame times by number of objects."""
    subject = bench.subject("dragon")
    columns = {
        "objects": "objects",
        "pixels_high": "pixels high",
        "mesh_ms": "mesh, ms",
        "impostor_ms": "impostor, ms",
        "impostor_shadow_ms": "impostor + shadow, ms",
        "plain_ms": "plain quads, ms",
        "speed_up": "mesh / (impostor + shadow)",
        "moving_ms": "viewer moves, ms",
        "moving_speed_up": "mesh / viewer moves",
    }
    table = Table("frames", f"Frame time: {subject.label} as mesh and as impostor", columns)
    for count, pixels_high in HEIGHTS.items():
        say(f"frames: {count} objects")
        field = Field(bench.ctx, bench.fan("dragon"), count, pixels_high)
        field.impostors_and_shadows()
        plain = PlainQuads(field)
        plain.prepare(BILINEAR)
        jobs = (field.impostors_and_shadows, field.impostors, lambda plain=plain: plain.draw(BILINEAR))
        times = alternate(*jobs, ctx=bench.ctx)
        moving = alternate(field.impostors_and_shadows_moving, ctx=bench.ctx).median(0)
        mesh, speed_up, note = against_mesh(bench, field)
        values = {
            "objects": count,
            "pixels_high": pixels_high,
            "mesh_ms": mesh * 1e3,
            "impostor_ms": times.median(1) * 1e3,
            "impostor_shadow_ms": times.median(0) * 1e3,
            "plain_ms": times.median(2) * 1e3,
            "speed_up": speed_up,
            "moving_ms": moving * 1e3,
            "moving_speed_up": mesh / moving,
        }
        bars = (Bar("speed_up", ">=", SPEED_UPS[count]),) if count in SPEED_UPS and subject.real else ()
        table.rows.append(Row(str(count), f"{count} x {pixels_high} px", values, bars, note))
        plain.release()
        field.release()
    table.notes.append(
        f"{SCENE}. The mesh has {bench.model('dragon').triangle_count:,} triangles and casts no "
        "shadow. Every frame clears colour and depth. Lights and viewer stand still, and what is found for one frame "
        "serves the next; in the last two columns the viewer moves: quads and shadows are found and "
        "drawn anew."
    )
    return table


def against_mesh(bench: Workbench, field: Field) -> tuple[float, float, str]:
    """Seconds of a frame of meshes, its ratio to impostors with shadows, and a note where it was not drawn whole."""
    meshes = MeshField(field, bench.model("dragon"))
    try:
        one = alternate(lambda: meshes.meshes(1), ctx=bench.ctx, repeats=3).median(0)
        whole = one * field.count
        drawn = field.count if whole <= LONGEST_FRAME else max(math.floor(LONGEST_FRAME / 4 / one), 1)
        repeats = 7 if whole < 3 else 3 if whole < LONGEST_FRAME / 2 and drawn == field.count else 1
        jobs = (lambda: meshes.meshes(drawn), field.impostors_and_shadows)
        times = alternate(*jobs, ctx=bench.ctx, repeats=repeats, warm_up=1)
    finally:
        meshes.release()
    share = field.count / drawn
    note = "" if share == 1 else f"mesh: {drawn} of {field.count} drawn, time multiplied up"
    return times.median(0) * share, times.ratio(0, 1) * share, note


def run_fill(bench: Workbench) -> Table:
    """The impostor pass against the same quads with one texture fetch."""
    subject = bench.subject("dragon")
    columns = {
        "objects": "objects",
        "plain_ms": "plain, bilinear, ms",
        "plain_trilinear_ms": "plain, trilinear, ms",
        "still_ms": "impostors, all still, ms",
        "still_ratio": "still / plain",
        "still_alone_ratio": "still / plain, alone",
        "still_trilinear_ratio": "still / trilinear",
        "moving_ms": "viewer moves, ms",
        "relit_ms": "lights change, ms",
        "relit_ratio": "lights change / plain",
        "relit_alone_ratio": "lights change / plain, alone",
        "sun_ms": "sun creeps on, ms",
        "clear_ms": "clear alone, ms",
    }
    table = Table("fill", "The impostor pass against plain textured quads", columns)
    for count, pixels_high in HEIGHTS.items():
        say(f"fill: {count} objects")
        field = Field(bench.ctx, bench.fan("dragon"), count, pixels_high)
        field.impostors()
        plain = PlainQuads(field)
        still, trilinear = (against_plain(field, plain, fetch) for fetch in (BILINEAR, TRILINEAR))
        # Apart, because it would undo what the still frames keep.
        moving = alternate(field.impostors_moving, ctx=bench.ctx)
        sun = alternate(field.impostors_under_a_moving_sun, ctx=bench.ctx)
        values = {
            "objects": count,
            "plain_ms": still.median(1) * 1e3,
            "plain_trilinear_ms": trilinear.median(1) * 1e3,
            "still_ms": still.median(2) * 1e3,
            "still_ratio": still.ratio(2, 1),
            "still_alone_ratio": still.net_ratio(2, 1, 0),
            "still_trilinear_ratio": trilinear.ratio(2, 1),
            "moving_ms": moving.median(0) * 1e3,
            "relit_ms": still.median(3) * 1e3,
            "relit_ratio": still.ratio(3, 1),
            "relit_alone_ratio": still.net_ratio(3, 1, 0),
            "sun_ms": sun.median(0) * 1e3,
            "clear_ms": still.median(0) * 1e3,
        }
        bars = (Bar("still_ratio", "<=", 1.5), Bar("relit_ratio", "<=", 4.0))
        table.rows.append(Row(str(count), f"{count} x {pixels_high} px", values, bars if subject.real else ()))
        plain.release()
        field.release()
    table.notes.append(
        f"{SCENE}. The plain quads are the impostor pass's own rectangles in its own order, drawn in one bare call "
        "from an RGBA8 copy of its tiles with one fetch, the same alpha cut-off, blending and depth test, at the "
        "quad's own depth. Where all stands still the pass keeps the quads of the last frame; where the viewer moves "
        "it finds them anew; where lights jump it relights every tile in every frame; where the sun creeps on, a "
        "twentieth of a degree a frame, tiles wait their turn while they are off by less than half a degree or so. All "
        "frames clear colour and depth; the impostors' read and restore the caller's OpenGL state. In the columns "
        "`alone` the clear is taken off both."
    )
    return table


def against_plain(field: Field, plain: PlainQuads, fetch: str) -> Times:
    """Seconds of frames: clear, plain, still, relit."""
    plain.prepare(fetch)
    jobs = (field.empty, lambda: plain.draw(fetch), field.impostors, field.impostors_relit)
    return alternate(*jobs, ctx=field.ctx)
