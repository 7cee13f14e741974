"""OpenGL contexts, programs and uploads: what every pass stands on."""

from __future__ import annotations

from typing import Any

import moderngl

from impostor.errors import GpuError

EGL_PACKAGES = "libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri"


def make_context() -> moderngl.Context:
    """A context without a window: EGL where there is one, the platform's own otherwise.

    Raises
    ------
    GpuError
        No OpenGL 3.3 to be had; the message says what to install.
    """
    problems = []
    egl: dict[str, Any] = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
    for options in (egl, {}):
        try:
            context = moderngl.create_context(require=330, standalone=True, **options)
        except Exception as problem:
            problems.append(str(problem).strip() or type(problem).__name__)
        else:
            return context
    reasons = "; ".join(problems)
    raise GpuError("OpenGL", f"no context of version 3.3 ({reasons}); on Debian or Ubuntu install {EGL_PACKAGES}")
