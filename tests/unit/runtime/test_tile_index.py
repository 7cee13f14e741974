"""Tiles found by number, many at once."""

import numpy as np

from runtime.fans.tiles import TileIndex


def test_tiles_are_found_in_whatever_order_they_came():
    random = np.random.default_rng(0)
    keys = random.permutation(np.arange(-500, 500))
    places = random.integers(0, 4096, (len(keys), 3), np.int32)
    index = TileIndex()
    for part in np.split(np.arange(len(keys)), [1, 40, 41, 700]):
        assert (index.find(keys[part]) == -1).all()
        index.add(keys[part], places[part])
    asked = random.integers(-600, 600, 5000)
    entries = index.find(asked)
    np.testing.assert_array_equal(entries >= 0, np.isin(asked, keys))
    expected = dict(zip(keys.tolist(), places.tolist(), strict=True))
    for key, entry in zip(asked.tolist(), entries.tolist(), strict=True):
        assert entry < 0 or index.places[entry].tolist() == expected[key]


def test_an_entry_stays_where_it_is_and_has_no_picture_at_first():
    index = TileIndex()
    index.add(np.array([5, 3]), np.zeros((2, 3), np.int32))
    entries = index.find(np.array([3, 5]))
    assert (index.versions[entries] < 0).all()
    index.versions[entries] = 7, 9
    index.add(np.array([4]), np.ones((1, 3), np.int32))
    assert index.versions[index.find(np.array([3, 4, 5]))].tolist() == [7, -1, 9]
