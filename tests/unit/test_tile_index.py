"""Tiles found by number, many at once."""

import numpy as np

from runtime.tiles import LastTiles, TileIndex


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


def test_only_copies_that_show_another_tile_than_last_are_looked_up():
    last = LastTiles(TileIndex(), count=5)
    copies = np.array([0, 2, 3])
    assert last.changed(copies, np.array([7, 7, 9])).tolist() == [0, 1, 2]
    last.remember(copies, np.array([7, 7, 9]), np.array([4, 4, 1]))
    assert last.entries(np.array([3, 0])).tolist() == [1, 4]
    assert last.changed(np.array([0, 1, 2, 3]), np.array([7, 7, 8, 9])).tolist() == [1, 2]
