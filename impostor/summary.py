"""What a person wants to know of a fan, a PTM or a model at a glance."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impostor.fan import Fan
from impostor.files.fan_file import read_fan, read_manifest
from impostor.files.pictures import save_png
from impostor.files.ptm_file import read_header, read_ptm
from impostor.model import load_model
from impostor.normal_code import palette

SHEET_VIEWS = 8
SCALE_FIGURES = 4


def fan_summary(path: Path) -> dict[str, Any]:
    """A description of a `.fan` file, ready for JSON."""
    manifest = read_manifest(path)
    fan = read_fan(path)
    size = path.stat().st_size
    albedo = fan.uniform_albedo
    return {
        "file": str(path),
        "bytes": size,
        "name": manifest.name,
        "format_version": manifest.version,
        "layout": manifest.layout,
        "views": len(manifest.views),
        "tile_size": manifest.size,
        "normal_levels": len(fan.normal),
        "camera": "orthographic" if manifest.distance is None else f"perspective at {manifest.distance:g} m",
        "bounds_m": _ranges(fan.bounds),
        "texel_m": _short(2 * float(fan.views.radius[0]) / fan.size),
        "covered_texels": fan.covered_texels,
        "bytes_per_covered_texel": round(size / max(fan.covered_texels, 1), 3),
        "uniform_albedo": None if albedo is None else "#{:02x}{:02x}{:02x}".format(*albedo),
        "source": manifest.source.get("name"),
        "source_sha256": manifest.source.get("sha256"),
        "settings": dict(sorted(manifest.settings.items())),
        "written_by": manifest.tool,
    }


def ptm_summary(path: Path) -> dict[str, Any]:
    """A description of a `.ptm` file, ready for JSON."""
    header, trailer = read_header(path)
    read_ptm(path)  # a file that cannot be drawn is not described
    size = path.stat().st_size
    summary: dict[str, Any] = {
        "file": str(path),
        "bytes": size,
        "version": header.version,
        "format": header.format,
        "width": header.width,
        "height": header.height,
        "bytes_per_texel": round(size / (header.width * header.height), 3),
        "scale": [float(f"{value:.{SCALE_FIGURES}g}") for value in header.scale],
        "bias": header.bias.tolist(),
        "curve": trailer.curve,
        "parameters": trailer.parameters,
        "written_by": trailer.tool or None,
    }
    if header.planes:
        summary["jpeg_quality"] = header.quality
        summary["planes_predicted"] = sum(plane.reference >= 0 for plane in header.planes)
        summary["planes_inverted"] = sum(plane.inverted for plane in header.planes)
        summary["side_bytes"] = sum(plane.side_bytes for plane in header.planes)
    return summary


def model_summary(path: Path, up: str = "y") -> dict[str, Any]:
    """A description of a model file, ready for JSON."""
    model = load_model(path, up=up)
    textures = {id(part.material.texture): part.material.texture for part in model.primitives}
    maps = {id(part.material.normal_map): part.material.normal_map for part in model.primitives}
    normals = [found.picture for found in maps.values() if found is not None]
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "name": model.name,
        "triangles": model.triangle_count,
        "vertices": model.vertex_count,
        "materials": [f"{part.material.name} ({part.material.alpha_mode.lower()})" for part in model.primitives],
        "textures": _sizes([texture for texture in textures.values() if texture is not None]),
        "normal_maps": _sizes(normals),
        "vertex_colors": any(part.colors is not None for part in model.primitives),
        "bounds_m": _ranges(model.bounds),
        "radius_m": _short(model.radius),
        "sha256": model.source_hash,
    }


def _sizes(pictures: list[NDArray[np.uint8]]) -> list[str]:
    return [f"{picture.shape[1]}x{picture.shape[0]}" for picture in pictures]


def _ranges(bounds: NDArray[np.float64]) -> list[list[float]]:
    """Least and greatest x, y and z, as finely as the object is large: it may be far from the origin."""
    size = float(np.ptp(bounds, axis=0).max())
    return [[_short(low, size), _short(high, size)] for low, high in bounds.T.tolist()]


def _short(metres: float, size: float = np.inf) -> float:
    """Rounded for reading: to six figures of its own, or of a size that is smaller."""
    smaller = min(abs(metres), size)
    return round(metres, 5 - math.floor(math.log10(smaller))) if smaller else metres


def contact_sheet(fan: Fan) -> NDArray[np.uint8]:
    """Colour, normals, depth and silhouette, a row each, of eight views around: (4 S, 8 S, 3) uint8."""
    chosen = np.linspace(0, len(fan.views), min(SHEET_VIEWS, len(fan.views)), endpoint=False).astype(int)
    alpha = fan.color[chosen, ..., 3:].astype(np.float32) / 255
    color = fan.color[chosen, ..., :3] * alpha + 128 * (1 - alpha)
    normal = palette()[fan.normal[0][chosen]]
    depth = np.repeat(fan.depth[chosen, ..., None] >> 8, 3, axis=-1)
    silhouette = np.repeat(fan.silhouette[chosen, ..., None] * 255, 3, axis=-1)
    rows = [np.hstack(list(layer.astype(np.uint8))) for layer in (color, normal, depth, silhouette)]
    return np.vstack(rows)


def write_contact_sheet(fan: Fan, path: Path, force: bool = False) -> None:
    """Write `contact_sheet` as a PNG, all of it or nothing."""
    save_png(path, contact_sheet(fan), force=force)
