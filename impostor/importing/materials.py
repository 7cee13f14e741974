"""Materials of a model: colour factors, textures with their alpha, and the MTL files of OBJ."""

from __future__ import annotations

import io
import itertools
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image, UnidentifiedImageError
from scipy.ndimage import distance_transform_edt

from impostor.errors import ModelError, ModelWarning, SettingsError
from impostor.importing.sources import ModelFiles, utf8
from impostor.srgb import linear_from_srgb

LARGEST_TEXTURE = 16384
LEAST_BLUE = 128  # of a normal map: less would face into the surface
_KTX2_MAGIC = b"\xabKTX 20\xbb"
_ALPHA_IS_OPAQUE = 250
_BINARY_SHARE = 0.2
_MTL_OPTION_VALUES = {
    "-blendu": 1, "-blendv": 1, "-bm": 1, "-boost": 1, "-cc": 1, "-clamp": 1,
    "-imfchan": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class NormalMap:
    """A picture of normals, laid on a surface along its tangents.

    Attributes
    ----------
    picture : ndarray, (H, W, 3) uint8
        Right, up and out of the picture, 128 for 0 and 255 for 1; row 0 is the top.
    scale : float
        Of what leans right and up; below 0 what is raised is hollow.
    clamp : tuple of bool
        As a material's.
    """

    picture: np.ndarray
    scale: float = 1.0
    clamp: tuple[bool, bool] = (False, False)

    def __post_init__(self):
        found = getattr(self.picture, "shape", type(self.picture).__name__), getattr(self.picture, "dtype", "")
        if found[1] != np.uint8 or len(found[0]) != 3 or found[0][2] != 3 or not self.picture.size:
            raise SettingsError("normal map", f"a picture of {found[0]} {found[1]}; expected (H, W, 3) uint8")
        if not np.isfinite(self.scale):
            raise SettingsError("normal map", f"scale {self.scale}; expected a finite number")


@dataclass(frozen=True, eq=False)
class Material:
    """The surface of a model: its colour before any light falls on it, and how its normals lean.

    Attributes
    ----------
    name : str
    base_color : tuple of 4 float
        Linear RGBA factor; multiplies texture and vertex colours.
    texture : ndarray, (H, W, 4) uint8, or None
        sRGB colour and linear alpha; row 0 is the top of the picture.
    alpha_mode : {"OPAQUE", "MASK", "BLEND"}
    alpha_cutoff : float
        For MASK: covered where alpha is at least this.
    double_sided : bool
    clamp : tuple of bool
        Whether the picture's edge goes on beyond it along u and along v; else the picture repeats.
    normal_map : NormalMap, optional
    """

    name: str = "default"
    base_color: tuple[float, float, float, float] = (0.8, 0.8, 0.8, 1.0)
    texture: np.ndarray | None = None
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: float = 0.5
    double_sided: bool = True
    clamp: tuple[bool, bool] = (False, False)
    normal_map: NormalMap | None = None


def warn(files: ModelFiles, problem: str) -> None:
    """Tell the user, in one line, what is drawn differently from what the file asks for."""
    warnings.warn(ModelWarning(f"{files.path}: {problem}"), stacklevel=3)


def read_texture(files: ModelFiles, reference: str, place: str, allow_missing: bool) -> np.ndarray | None:
    """Pixels of a texture the model refers to; None only where a missing one is allowed."""
    try:
        data = files.read(reference, place)
    except ModelError as error:
        if not allow_missing:
            raise
        warn(files, f"{error.problem}; drawn without it")
        return None
    return decode_texture(files, data, f"{place}: '{reference[:80]}'")


def read_normals(files: ModelFiles, name: str, read: Callable[[], np.ndarray | None]) -> np.ndarray | None:
    """Pixels (H, W, 3) of a normal map; None, with a warning, where it cannot be used: the object is whole without.

    Texels that no surface shows often hold no normal: they get that of the nearest that does.
    """
    try:
        found = read()
    except ModelError as error:
        warn(files, f"{error.problem}; drawn without it")
        return None
    if found is None:
        return None
    if (found[..., :1] == found[..., 1:3]).all():
        warn(files, f"normal map of material '{name}' is grey, as heights are; drawn without it")
        return None
    empty = found[..., 2] < LEAST_BLUE
    if empty.all():
        warn(files, f"normal map of material '{name}': blue is below {LEAST_BLUE} everywhere; drawn without it")
        return None
    return np.ascontiguousarray(_filled(found[..., :3], empty) if empty.any() else found[..., :3])


def decode_texture(files: ModelFiles, data: bytes, place: str) -> np.ndarray:
    """Decode an image file.

    Returns
    -------
    ndarray, (H, W, 4) uint8
        sRGB colour and linear alpha, row 0 at the top.

    Raises
    ------
    ModelError
        For KTX2 and for what Pillow cannot decode whole.
    """
    if data.startswith(_KTX2_MAGIC):
        raise ModelError(files.path, f"{place} is a KTX2 texture; expected PNG, JPEG or WebP")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(data))
            if max(image.size) > LARGEST_TEXTURE:
                width, height = image.size
                raise ModelError(files.path, f"{place} is {width}x{height}; expected at most {LARGEST_TEXTURE} a side")
            return pixels(image)
    except ModelError:
        raise
    except UnidentifiedImageError as error:
        raise ModelError(files.path, f"{place} cannot be decoded; expected an image") from error
    except Exception as error:
        raise ModelError(files.path, f"{place} cannot be decoded ({error}); expected an image") from error


def pixels(image: Image.Image) -> np.ndarray:
    """An opened image as (H, W, 4) uint8."""
    # Pillow clips 16-bit grey at 255 when it converts, so the high byte is taken here.
    if image.mode.startswith("I"):
        grey = np.asarray(image, np.int64)
        image = Image.fromarray(np.clip(grey >> 8, 0, 255).astype(np.uint8))
    return np.array(image.convert("RGBA"))


def with_alpha_mode(material: Material) -> Material:
    """OPAQUE, MASK or BLEND from the alpha itself, for formats that do not say which.

    MASK when fewer than a fifth of the texels are neither covered nor clear, else BLEND.
    """
    factor = material.base_color[3]
    alpha = np.full(1, 255, np.uint8) if material.texture is None else material.texture[..., 3]
    if factor >= 1.0 and (alpha.min() >= _ALPHA_IS_OPAQUE or alpha.max() == 0):
        return replace(material, alpha_mode="OPAQUE")
    partial = (alpha > 255 - _ALPHA_IS_OPAQUE) & (alpha < _ALPHA_IS_OPAQUE)
    binary = factor >= 1.0 and partial.mean() < _BINARY_SHARE
    return replace(material, alpha_mode="MASK" if binary else "BLEND")


def finished(files: ModelFiles, material: Material) -> Material:
    """The material as it is drawn: alpha 1 where OPAQUE, no black border in clear texels elsewhere."""
    texture = material.texture
    if material.alpha_mode == "OPAQUE":
        if texture is not None and texture[..., 3].min() < 255:
            texture = texture.copy()
            texture[..., 3] = 255
        return replace(material, texture=texture, base_color=(*material.base_color[:3], 1.0))
    if material.alpha_mode == "BLEND":
        warn(files, f"material '{material.name}': alpha mode BLEND, drawn as stippled coverage")
    return replace(material, texture=None if texture is None else fill_clear_texels(texture))


def fill_clear_texels(texture: np.ndarray) -> np.ndarray:
    """Give every texel of alpha 0 the colour of the nearest texel that has any, so that filtering bleeds no border.

    Parameters
    ----------
    texture : ndarray, (H, W, 4) uint8

    Returns
    -------
    ndarray, (H, W, 4) uint8
        Alpha unchanged.
    """
    clear = texture[..., 3] == 0
    if not clear.any() or clear.all():
        return texture
    return _filled(texture, clear)


def _filled(texture: np.ndarray, empty: np.ndarray) -> np.ndarray:
    """A picture with the colour of the nearest other texel in those that are empty."""
    rows, columns = distance_transform_edt(empty, return_distances=False, return_indices=True)  # type: ignore[misc]
    filled = texture.copy()
    filled[..., :3] = texture[rows, columns, :3]
    return filled


def mirrored(texture: np.ndarray, across: bool, down: bool) -> np.ndarray:
    """A picture with its mirror image right of it, below it, or both: repeated it is the picture mirrored."""
    texture = np.concatenate([texture, texture[:, ::-1]], axis=1) if across else texture
    return np.concatenate([texture, texture[::-1]]) if down else texture


def read_mtl(files: ModelFiles, reference: str, allow_missing: bool) -> dict[str, Material]:
    """Materials of an MTL file by name: Kd, d or Tr, map_Kd, map_d, norm or map_Kn.

    Kd is taken as an sRGB value, the way it looks on screen.
    """
    place = f"mtllib '{reference}'"
    statements: dict[str, dict[str, str]] = {}
    current: dict[str, str] = {}
    text = utf8(files.read(reference, place)).decode()
    for line in text.replace("\\\n", " ").splitlines():
        key, _, value = line.strip().replace("\t", " ").partition(" ")
        if key.lower() == "newmtl":
            current = statements.setdefault(" ".join(value.split()), {})
        elif value:
            current[key.lower()] = value.strip()
    rough = [name for name, lines in statements.items() if lines.keys() & {"bump", "map_bump"}]
    if rough:
        more = f" and {len(rough) - 1} more" if len(rough) > 1 else ""
        warn(files, f"material '{rough[0]}'{more}: height map (bump) is not drawn")
    return {name: _mtl_material(files, name, lines, allow_missing) for name, lines in statements.items()}


def _mtl_material(files: ModelFiles, name: str, lines: dict[str, str], allow_missing: bool) -> Material:
    place = f"material '{name}'"
    color = _mtl_numbers(files, f"{place}: Kd", lines["kd"]) if "kd" in lines else [0.8]
    color = (color * 3)[:3] if len(color) == 1 else (color + color[-1:] * 2)[:3]
    red, green, blue = (float(c) for c in linear_from_srgb(np.array(color)))
    base_color = (red, green, blue, _mtl_opacity(files, place, lines))
    texture = _mtl_texture(files, place, lines, allow_missing)
    clamp = "map_kd" in lines and _mtl_clamps(lines["map_kd"])
    normals = _mtl_normals(files, name, lines, allow_missing)
    material = Material(name, base_color, texture, clamp=(clamp, clamp), normal_map=normals)
    return finished(files, with_alpha_mode(material))


def _mtl_normals(files: ModelFiles, name: str, lines: dict[str, str], allow_missing: bool) -> NormalMap | None:
    key = next((key for key in ("norm", "map_kn") if key in lines), None)
    if key is None:
        return None
    reference, place, clamp = _mtl_reference(lines[key]), f"material '{name}': {key}", _mtl_clamps(lines[key])
    picture = read_normals(files, name, lambda: read_texture(files, reference, place, allow_missing))
    return None if picture is None else NormalMap(picture, clamp=(clamp, clamp))


def _mtl_opacity(files: ModelFiles, place: str, lines: dict[str, str]) -> float:
    if "d" in lines:
        value = lines["d"].replace("-halo", "").strip()
        return float(np.clip(_mtl_numbers(files, f"{place}: d", value)[0], 0.0, 1.0))
    if "tr" in lines:
        clear = _mtl_numbers(files, f"{place}: Tr", lines["tr"])[0]
        # Tr 1 means clear in the format and opaque in many exporters' files; nobody ships an invisible model.
        return 1.0 if clear >= 1.0 else float(np.clip(1.0 - clear, 0.0, 1.0))
    return 1.0


def _mtl_numbers(files: ModelFiles, place: str, value: str) -> list[float]:
    try:
        numbers = [float(word) for word in value.split()[:3]]
    except ValueError:
        numbers = []
    if not numbers or not np.isfinite(numbers).all():
        raise ModelError(files.path, f"{place} is '{value}'; expected one or three numbers")
    return numbers


def _mtl_texture(files: ModelFiles, place: str, lines: dict[str, str], allow_missing: bool) -> np.ndarray | None:
    color = opacity = None
    if "map_kd" in lines:
        color = read_texture(files, _mtl_reference(lines["map_kd"]), f"{place}: map_Kd", allow_missing)
    if "map_d" in lines:
        opacity = read_texture(files, _mtl_reference(lines["map_d"]), f"{place}: map_d", allow_missing)
    if opacity is None:
        return color
    alpha = opacity[..., 3] if opacity[..., 3].min() < 255 else opacity[..., :3].max(-1)
    if color is None:
        color = np.full((*alpha.shape, 4), 255, np.uint8)
    if alpha.shape != color.shape[:2]:
        size = Image.fromarray(color).size
        alpha = np.asarray(Image.fromarray(alpha).resize(size, Image.Resampling.BILINEAR))
    return np.dstack([color[..., :3], alpha])


def _mtl_reference(value: str) -> str:
    """The file name behind a map statement's options; names may hold spaces."""
    option, _, rest = value.partition(" ")
    while option.lower() in _MTL_OPTION_VALUES and rest:
        count = _MTL_OPTION_VALUES[option.lower()]
        for _ in range(count):
            word, _, after = rest.strip().partition(" ")
            # The options of three numbers may be written with fewer.
            if not after or (count > 1 and not _is_number(word)):
                break
            rest = after
        value = rest.strip()
        option, _, rest = value.partition(" ")
    return value


def _mtl_clamps(value: str) -> bool:
    """Whether a map statement's options ask for clamping."""
    options = value[: len(value) - len(_mtl_reference(value))].lower().split()
    return ("-clamp", "on") in itertools.pairwise(options)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
