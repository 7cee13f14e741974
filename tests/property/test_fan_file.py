"""Write then read is the identity, whatever the fan."""

import tempfile
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from impostor.fan import Fan
from impostor.files.fan_file import read_fan, validate_fan, write_fan
from impostor.views import LAYOUTS, Views, basis_facing
from tests.fans import assert_same_fan, sound_codes

finite = st.floats(-1e6, 1e6)
plain = st.one_of(st.none(), st.booleans(), st.integers(-(2**53), 2**53), finite, st.text(max_size=8))


@st.composite
def fans(draw):
    count, size = draw(st.integers(1, 7)), draw(st.integers(8, 17))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    low = rng.normal(size=count)
    depth_range = np.stack([low, low + rng.uniform(0.001, 3, count)], axis=-1)
    distance = draw(st.one_of(st.just(np.inf), st.floats(depth_range.max() + 4, 1e9)))
    center = np.array(draw(st.lists(finite, min_size=3 * count, max_size=3 * count))).reshape(count, 3)
    views = Views(
        basis_facing(rng.normal(size=(count, 3))),
        center,
        rng.uniform(1e-6, 1e6, count),
        depth_range,
        distance,
        rng.normal(size=(count, 3)) - 4,
    )
    color = rng.integers(0, 256, (count, size, size, 4), np.uint8)
    levels = range(draw(st.integers(1, size.bit_length())))
    normal = tuple(sound_codes(rng.integers(0, 256, (count, max(size >> k, 1), max(size >> k, 1)))) for k in levels)
    depth = rng.integers(0, 65536, (count, size, size)).astype(np.uint16)
    source = draw(st.dictionaries(st.sampled_from(["name", "sha256"]), st.text(max_size=8)))
    asked = draw(st.dictionaries(st.text(max_size=5), st.one_of(plain, st.lists(plain, max_size=3)), max_size=3))
    layout = draw(st.sampled_from(LAYOUTS))
    return Fan(draw(st.text(max_size=9)), layout, views, color, normal, depth, color[..., 3] >= 128, source, asked)


@settings(max_examples=40, deadline=None)
@given(fans())
def test_write_then_read_is_the_identity(fan):
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "a.fan"
        write_fan(path, fan)
        first = path.read_bytes()
        assert_same_fan(read_fan(path), fan)
        assert validate_fan(path) == []
        write_fan(path, read_fan(path), force=True)
        assert path.read_bytes() == first
