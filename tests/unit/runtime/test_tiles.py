"""Places in the tile cache, and how tiles lie in an atlas."""

import numpy as np
import pytest

from impostor.errors import GpuError
from runtime.fans.tiles import GUTTER, CacheFull, TileCache
from runtime.gl.uploads import tiles_to_atlas


@pytest.fixture
def cache(ctx):
    cache = TileCache(ctx, side=256)
    yield cache
    cache.release()


def squares(places, gutter):
    return [
        {(x + i, y + j) for i in range(-gutter, side + gutter) for j in range(-gutter, side + gutter)}
        for x, y, side in places.tolist()
    ]


def test_places_with_their_gutters_never_overlap_and_stay_inside(cache):
    sizes = [64, 16, 16, 40, 33, 8, 1, 4, 64, 16, 5]
    places = np.concatenate([cache.place(sizes[:4]), cache.place(sizes[4:])])
    assert places[:, 2].tolist() == sizes
    covered = squares(places, GUTTER)
    assert len(set().union(*covered)) == sum(map(len, covered))
    assert places[:, :2].min() >= GUTTER
    assert (places[:, :2] + places[:, 2:]).max() <= cache.side - GUTTER


@pytest.mark.parametrize(("size", "count"), [(128, 4), (64, 9), (16, 14 * 14)])
def test_the_cache_holds_as_many_tiles_as_fit_and_no_more(cache, size, count):
    places = cache.place([size] * count)
    assert len({(x, y) for x, y, _ in places.tolist()}) == count
    with pytest.raises(CacheFull):
        cache.place([size])
    cache.clear()
    one_by_one = np.concatenate([cache.place([size]) for _ in range(count)])
    np.testing.assert_array_equal(one_by_one, places)


@pytest.mark.parametrize("size", [1, 63, 64, 100, 256, 1024])
def test_the_least_cache_for_a_size_holds_one(ctx, size):
    cache = TileCache(ctx, TileCache.side_for(size))
    cache.place([size])
    cache.release()


def test_no_tiles_need_no_place(cache):
    assert cache.place([]).shape == (0, 3)


def test_a_cache_that_the_gpu_cannot_hold_is_refused(ctx):
    with pytest.raises(GpuError, match=r"^tile cache: needs a texture of 1064960x1064960"):
        TileCache(ctx, side=1 << 20)


@pytest.mark.parametrize("count", [1, 2, 5, 12, 96])
def test_tiles_lie_in_the_atlas_row_by_row(count):
    tiles = np.random.default_rng(0).integers(1, 256, (count, 3, 3, 2), np.uint8)
    atlas = tiles_to_atlas(tiles)
    columns = atlas.shape[1] // 3
    for index, tile in enumerate(tiles):
        row, column = divmod(index, columns)
        np.testing.assert_array_equal(atlas[row * 3 : row * 3 + 3, column * 3 : column * 3 + 3], tile)
    assert np.count_nonzero(atlas) == np.count_nonzero(tiles)
