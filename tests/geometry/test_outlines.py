import numpy as np
from hypothesis import given, strategies as st

from stablepush.geometry import nearest_on_outline

OUTLINE = np.array([(0.0, 0.0), (0.16, 0.0), (0.16, 0.05), (0.05, 0.05), (0.05, 0.13), (0.0, 0.13)])


@given(st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)), min_size=1, max_size=5))
def test_the_nearest_place_against_a_search_along_the_edges(points):
    points = np.array(points)
    near, along = nearest_on_outline(OUTLINE, points)
    ends = np.roll(OUTLINE, -1, axis=0)
    # the point of each edge at the share of it where the perpendicular stands
    edge = ends - OUTLINE
    share = np.clip(((points[:, None] - OUTLINE) * edge).sum(axis=2) / (edge**2).sum(axis=1), 0, 1)
    feet = OUTLINE + share[..., None] * edge
    distance = np.linalg.norm(feet - points[:, None], axis=2).min(axis=1)
    assert np.allclose(np.linalg.norm(near - points, axis=1), distance, atol=1e-12)
    lengths = np.concatenate(([0.0], np.cumsum(np.linalg.norm(edge, axis=1))))
    k = np.clip(np.searchsorted(lengths, along, side="right") - 1, 0, len(edge) - 1)
    assert np.allclose(OUTLINE[k] + (along - lengths[k])[:, None] * edge[k] / np.linalg.norm(edge[k], axis=1)[:, None], near)


def test_what_is_not_known_stays():
    near, along = nearest_on_outline(OUTLINE, np.array([(0.1, -0.02), (np.nan, 0.0)]))
    assert near[0].tolist() == [0.1, 0.0] and np.isnan(near[1]).all() and along[0] == 0.1 and np.isnan(along[1])
