"""Domes of lights: counts, places, and names on the command line."""

import numpy as np
import pytest

from bake.dome import fibonacci_dome, geodesic_dome, parse_dome, ring_dome
from impostor.errors import SettingsError


def test_geodesic_dome_is_the_40_faces_above_a_level_rim():
    lights = geodesic_dome()
    assert lights.shape == (40, 3)
    np.testing.assert_allclose(np.linalg.norm(lights, axis=1), 1)
    assert np.degrees(np.arcsin(lights[:, 2].min())) > 8
    # Turned by a fifth of a circle it is the same dome, and with its mirror image below it makes 80 faces.
    fifth = np.radians(72)
    turn = np.array([[np.cos(fifth), -np.sin(fifth), 0], [np.sin(fifth), np.cos(fifth), 0], [0, 0, 1]])
    distances = np.linalg.norm((lights @ turn.T)[:, None] - lights[None], axis=-1)
    assert distances.min(axis=1).max() < 1e-9
    assert len(np.unique(np.vstack([lights, -lights]).round(6), axis=0)) == 80


def test_geodesic_dome_has_no_gap():
    everywhere = fibonacci_dome(2000, np.radians(10))
    nearest = np.degrees(np.arccos((everywhere @ geodesic_dome().T).max(axis=1)))
    assert nearest.max() < 21


def test_rings_stand_at_their_elevations():
    lights = ring_dome([(np.radians(20), 12), (np.radians(60), 6), (np.radians(90), 1)])
    assert np.degrees(np.arcsin(lights[:, 2])) == pytest.approx([20] * 12 + [60] * 6 + [90])
    np.testing.assert_allclose(lights.sum(axis=0)[:2], 0, atol=1e-12)


def test_fibonacci_spreads_evenly_above_its_edge():
    lights = fibonacci_dome(200, np.radians(10))
    np.testing.assert_allclose(np.linalg.norm(lights, axis=1), 1)
    assert lights[:, 2].min() > np.sin(np.radians(10))
    gaps = np.linalg.norm(lights[:, None] - lights[None], axis=-1) + np.eye(200) * 9
    assert gaps.min(axis=1).max() < 1.6 * gaps.min(axis=1).min()


def test_names_on_the_command_line():
    assert len(parse_dome("geodesic")) == 40
    assert len(parse_dome("fibonacci:64")) == 64
    assert parse_dome("fibonacci:64:30")[:, 2].min() > 0.5
    assert len(parse_dome("rings:15x12,45x8,90x1")) == 21


@pytest.mark.parametrize(
    "text", ["", "geodesic:3", "fibonacci", "fibonacci:0", "fibonacci:9:95", "rings:", "rings:95x3", "rings:20"]
)
def test_other_names_are_refused(text):
    with pytest.raises(SettingsError):
        parse_dome(text)
