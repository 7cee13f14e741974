"""A video shows the colours that were put in, whatever its size."""

import av
import numpy as np
import pytest
from av.video.reformatter import Colorspace

from impostor.files.video import video_output


@pytest.mark.parametrize("height", [64, 720])  # players guess BT.601 below HD, BT.709 from there on
def test_a_video_says_how_its_colours_are_coded(tmp_path, height):
    color = (200, 60, 40)
    with video_output(tmp_path / "a.mp4", (64, height)) as add:
        add(np.full((height, 64, 3), color, np.uint8))
    with av.open(str(tmp_path / "a.mp4")) as container:
        frame = next(container.decode(video=0))
        assert frame.colorspace == Colorspace.ITU709
        shown = frame.reformat(format="rgb24", src_colorspace=Colorspace.ITU709).to_ndarray()
    np.testing.assert_allclose(shown[height // 2, 32], color, atol=3)
