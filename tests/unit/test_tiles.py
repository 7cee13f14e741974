"""Places in the tile cache, and how tiles lie in an atlas."""

import numpy as np
import pytest

from impostor.errors import GpuError
from runtime.gpu import tiles_to_atlas
from runtime.tiles import CacheFull, TileCache


@pytest.fixture
def cache(ctx):
    cache = TileCache(ctx, side=256, page=64)
    yield cache
    cache.release()


def squares(places):
    return [{(x + i, y + j) for i in range(side) for j in range(side)} for x, y, side in places.tolist()]


def test_places_never_overlap_and_stay_inside(cache):
    sizes = [64, 16, 16, 40, 33, 8, 1, 4, 64, 16, 5]
    places = np.concatenate([cache.place(sizes[:4]), cache.place(sizes[4:])])
    assert places[:, 2].tolist() == sizes
    covered = squares(places)
    assert len(set().union(*covered)) == sum(map(len, covered))
    assert places[:, :2].min() >= 0
    assert (places[:, :2] + places[:, 2:]).max() <= 256


def test_the_cache_holds_as_many_tiles_as_fit_and_no_more(cache):
    places = cache.place([16] * 256)
    assert len({(x, y) for x, y, _ in places.tolist()}) == 256
    with pytest.raises(CacheFull):
        cache.place([16])
    cache.clear()
    np.testing.assert_array_equal(cache.place([16] * 256), places)


def test_no_tiles_need_no_place(cache):
    assert cache.place([]).shape == (0, 3)


def test_a_cache_that_the_gpu_cannot_hold_is_refused(ctx):
    with pytest.raises(GpuError, match=r"^tile cache: needs a texture of 1048576x1048576"):
        TileCache(ctx, side=1 << 20, page=256)


@pytest.mark.parametrize("count", [1, 2, 5, 12, 96])
def test_tiles_lie_in_the_atlas_row_by_row(count):
    tiles = np.random.default_rng(0).integers(1, 256, (count, 3, 3, 2), np.uint8)
    atlas = tiles_to_atlas(tiles)
    columns = atlas.shape[1] // 3
    for index, tile in enumerate(tiles):
        row, column = divmod(index, columns)
        np.testing.assert_array_equal(atlas[row * 3 : row * 3 + 3, column * 3 : column * 3 + 3], tile)
    assert np.count_nonzero(atlas) == np.count_nonzero(tiles)
