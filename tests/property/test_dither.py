"""The parts of a dither that share out a pixel never overlap and leave no hole, however they are combined."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from runtime.fans.batch import Batch
from runtime.fans.lod import LevelOfDetail, Levels
from runtime.instances.dither import WHOLE, divided, part_of, rest_of
from runtime.instances.instances import Instances
from runtime.viewing.viewer import Viewer
from tests.pictures import filling
from tests.solids import Sphere, solid_fan

RANKS = ((np.arange(256) + 0.5) / 256).astype(np.float32)  # as crossfade.glsl has them
FAN = solid_fan(Sphere(), views=8, size=16)
VIEWER = Viewer.from_matrices(*filling(2.0), (0, 0, 64, 64))

shares = st.floats(0, 1, width=32)


def kept(parts):
    """Which ranks (N, 256) parts (N, 2) show, as the shader finds it."""
    return (parts[:, :1] <= RANKS) & (parts[:, 1:] > RANKS)


def column(value):
    return np.array([value], np.float32)


@given(shares)
def test_a_share_and_its_complement_show_every_pixel_once(share):
    first, second = kept(part_of(column(share))), kept(part_of(column(share) - 1))
    assert (first ^ second).all()


@given(shares, shares, st.booleans())
def test_a_part_is_divided_without_a_rest(share, inner, other_end):
    parts = part_of(column(-share if other_end else share))
    first, second = (kept(each) for each in divided(parts, column(inner)))
    np.testing.assert_array_equal(first ^ second, kept(parts))
    assert not (first & second).any()


@given(shares, shares, st.booleans())
def test_what_is_taken_and_what_is_left_are_the_whole(share, inner, other_end):
    whole = column(-share if other_end else share)
    taken = whole * np.float32(inner)
    first, second = kept(part_of(taken)), kept(rest_of(whole, taken))
    assert not (first & second).any()
    np.testing.assert_array_equal(first | second, kept(part_of(whole)))


@given(st.floats(-1, 1, width=32), shares, shares)
def test_copies_in_every_crossfade_at_once(share, fan_share, view_share):
    """Of one copy with a share, in a fade to its mesh and to its next view: as many parts as it takes, all apart."""
    instances = Instances(FAN)
    instances.shares = share
    levels = Levels(instances, None, LevelOfDetail())  # type: ignore[arg-type]
    levels.fan_share[:] = fan_share
    nothing: Any = SimpleNamespace()
    batch = Batch(instances, nothing, levels)
    batch.shown_to(VIEWER, 0.0, 1.0)
    fades = batch.fades
    fades.leaving[:], fades.share[:], fades.fading = 3, view_share, view_share < 1
    shown = batch.shown_to(VIEWER, None, 1.0)
    meshes = [[WHOLE] if group.parts is None else group.parts for group in levels.copies()]
    parts = [*shown.parts, *(part for each in meshes for part in each)]
    count = sum((kept(np.array([part], np.float32)).astype(int) for part in parts), np.zeros((1, 256), int))
    assert count.max() <= 1
    np.testing.assert_array_equal(count == 1, kept(part_of(instances.shares)))
