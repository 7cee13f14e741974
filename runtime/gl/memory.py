"""What is held on the GPU, in bytes, by what it is for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np

KINDS = (
    "fans",
    "tile cache",
    "colormaps",
    "instances",
    "shadow marks",
    "shadow strips",
    "meshes",
    "surfaces",
    "ground",
    "rooms",
    "picture",
)
OTHER = "other"
PACKAGE = __name__.partition(".")[0]


def memory_held(owner: object) -> dict[str, int]:
    """Bytes of all buffers and textures that an object of this package holds, directly or through others.

    They are found rather than kept account of, so that nothing can be forgotten. A class names the kind of what its
    objects hold in `memory_kind`; within one, another class may name another.

    Parameters
    ----------
    owner : object

    Returns
    -------
    dict of int
        By kind: "fans", "tile cache", "colormaps", "instances", "shadow marks", "shadow strips", "meshes", "surfaces",
        "ground", "rooms", "picture" and "other". Mip levels are counted as a third; what drivers add is not known.
    """
    found: Counter[str] = Counter(dict.fromkeys([*KINDS, OTHER], 0))
    known: set[int] = set()
    waiting: list[tuple[Any, str]] = [(owner, OTHER)]
    while waiting:
        thing, kind = waiting.pop()
        if id(thing) in known:
            continue
        known.add(id(thing))
        kind = getattr(type(thing), "memory_kind", kind)
        if isinstance(thing, moderngl.Buffer):
            found[kind] += thing.size
        elif isinstance(thing, moderngl.Texture | moderngl.TextureCube | moderngl.Renderbuffer):
            found[kind] += _texture_bytes(thing)
        else:
            waiting += [(part, kind) for part in _parts(thing)]
    return dict(found)


def _parts(thing: Any) -> list[Any]:
    """What an object of this package, or a container, is made of."""
    if isinstance(thing, Mapping):
        return list(thing.values())
    if isinstance(thing, list | tuple | set | frozenset):
        return list(thing)
    if type(thing).__module__.partition(".")[0] == PACKAGE:
        return list(getattr(thing, "__dict__", {}).values())
    return []


def _texture_bytes(texture: moderngl.Texture | moderngl.TextureCube | moderngl.Renderbuffer) -> int:
    bytes_a_channel = int(texture.dtype[-1])
    texels = int(np.prod(texture.size)) * (6 if isinstance(texture, moderngl.TextureCube) else 1)
    texels *= max(getattr(texture, "samples", 0), 1)
    with_levels = not isinstance(texture, moderngl.Renderbuffer) and texture.filter[0] not in (
        moderngl.NEAREST,
        moderngl.LINEAR,
    )
    return texels * texture.components * bytes_a_channel * (4 if with_levels else 3) // 3
