"""Table "overhead": what `ImpostorRenderer.draw` costs the CPU, the drawing itself left out."""

from __future__ import annotations

from benchmarks.scenes import HEIGHTS, Field
from benchmarks.tables import Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import Workbench


class _NoArray:
    """Stands in for the vertex array, and draws nothing."""

    def render(self, *_, **__) -> None:
        """Nothing."""


def run(bench: Workbench) -> Table:
    """Measure `draw` for up to 10,000 instances."""
    columns = {"instances": "instances", "still_ms": "all still, ms", "moving_ms": "viewer moves, ms"}
    table = Table("overhead", "`ImpostorRenderer.draw` without the draw call", columns)
    for count in (1, 100, 1000, 10000):
        field = Field(bench.ctx, bench.fan("dragon"), count, HEIGHTS.get(count, 10))
        field.impostors()
        quads = field.renderer._impostors._whole
        array, quads.array = quads.array, _NoArray()  # type: ignore[assignment]
        field.target.framebuffer.use()
        jobs = (
            lambda field=field: field.renderer.draw(*field.matrices),
            lambda field=field: field.renderer.draw(*field.shifted_matrices()),
        )
        still, moving = (alternate(job, ctx=bench.ctx).median(0) for job in jobs)
        quads.array = array
        values = {"instances": count, "still_ms": still * 1e3, "moving_ms": moving * 1e3}
        table.rows.append(Row(str(count), f"{count:,} instance{'s' * (count > 1)}", values))
        field.release()
    table.notes.append("Every instance is turned another way, so every one has a tile of its own. No tile is relit.")
    return table
