"""Files of sliders."""

import numpy as np

import stablepush as sp


def test_a_slider_is_read_as_it_was_written(tmp_path):
    slider = sp.Slider.centered([(0.0, 0.0), (0.12, 0.0), (0.12, 0.03), (0.03, 0.03), (0.03, 0.08), (0.0, 0.08)], mass=0.4)
    sp.save_slider(slider, tmp_path / "slider.json")
    again = sp.load_slider(tmp_path / "slider.json")
    np.testing.assert_array_equal(again.vertices, slider.vertices)
    assert again.mass == slider.mass
