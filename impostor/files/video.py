"""Pictures to a video: the one importer of PyAV."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from impostor.errors import OutputError
from impostor.files.output import atomic_output

CODEC, QUALITY = "libx264", "18"  # constant rate factor: below it few people see a difference
BT709, SRGB = 1, 13  # primaries and transfer function, by the numbers of ITU-T H.273


def film_size(size: tuple[int, int]) -> tuple[int, int]:
    """Width and height of a video of pictures: even, as H.264's colours have no room for an odd column or row."""
    return max(size[0] // 2 * 2, 2), max(size[1] // 2 * 2, 2)


@contextmanager
def video_output(
    path: str | os.PathLike[str], size: tuple[int, int], rate: int = 25, force: bool = False
) -> Iterator[Callable[[NDArray[np.uint8]], None]]:
    """A function that adds pictures to an H.264 video, which is there when the block ends well.

    Parameters
    ----------
    path : path-like
        Ends in `.mp4`.
    size : tuple of int
        Width and height in pixels; where one is odd, pictures lose their last column or row, as `film_size` has it.
    rate : int
        Pictures a second.
    force : bool
        Replace an existing file.

    Yields
    ------
    callable
        Takes (H, W, 3) uint8, sRGB.

    Raises
    ------
    OutputError
        The file exists, cannot be written, or a picture cannot be encoded.
    """
    import av
    from av.error import FFmpegError
    from av.video.reformatter import ColorRange, Colorspace

    width, height = film_size(size)
    with atomic_output(path, force) as temporary:
        try:
            with av.open(str(temporary), "w", format="mp4") as container:
                stream = container.add_stream(CODEC, rate=rate, options={"crf": QUALITY})
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
                # A player takes a video that does not say for BT.601 or BT.709 by its height.
                context = stream.codec_context
                context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG
                context.color_primaries, context.color_trc = BT709, SRGB

                def add(picture: NDArray[np.uint8]) -> None:
                    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]), format="rgb24")
                    frame = frame.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709)
                    container.mux(stream.encode(frame))

                yield add
                container.mux(stream.encode(None))
        except FFmpegError as error:
            raise OutputError(path, f"the video cannot be encoded: {error.strerror or error}") from error
