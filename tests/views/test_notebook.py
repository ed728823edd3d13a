"""What a notebook shows of fits, regions, plans and diagnoses."""

import html

import numpy as np
import pytest
from conftest import make_log, pairs, small_scene, triangle
from matplotlib.figure import Figure

import stablepush as sp
from stablepush.views.plot import plot_limit_surface, plot_plan, plot_wrench_paths


def test_a_plan_is_a_table_of_its_pushes_and_an_animation(tmp_path):
    problem = small_scene()
    result = sp.plan(problem, refinement_budget=0)
    shown = result._repr_html_()
    assert shown.count("<tr>") == 1 + 4 + 1 + len(result.pushes)
    assert f"{result.duration:.2f} s" in shown
    page = sp.animate(problem, result)
    assert page.html.startswith("<!doctype html>".upper()) or page.html.lower().startswith("<!doctype html>")
    assert html.escape(page.html) in page._repr_html_()
    assert len(repr(page)) < 40
    page.save(tmp_path / "plan.html")
    assert (tmp_path / "plan.html").read_text(encoding="utf-8") == page.html
    with pytest.raises(sp.InputError, match="result: expected a PlanResult, got NoneType"):
        sp.animate(problem, None)
    none = sp.PlanResult("no-path", "hand", message="a <wall> is in the way")
    assert "&lt;wall&gt;" in none._repr_html_()
    assert repr(none) == "PlanResult(no-path, hand, planned in 0 s: a <wall> is in the way)"
    assert f"{len(result.pushes)} push" in repr(result) and len(repr(result)) < 300


def test_axes_of_another_kind_are_refused():
    figure = Figure()
    flat, round_ = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2, projection="3d")
    surface = sp.fit_limit_surface(np.zeros((0, 3)), np.zeros((0, 3)), slider=triangle(), seed=0).surface
    with pytest.raises(sp.InputError, match='ax: expected axes of matplotlib with projection="3d", got Axes'):
        plot_wrench_paths(surface, {}, ax=flat)
    assert plot_wrench_paths(surface, {}, ax=round_) is round_
    with pytest.raises(sp.InputError, match="ax: expected plain axes of matplotlib, got str"):
        plot_plan(small_scene(), sp.PlanResult("no-path", "hand"), ax="here")


def test_fits_regions_and_reports_show_pictures():
    slider = triangle()
    surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 3.0)
    twists = np.random.default_rng(0).normal(size=(10, 3)) / (1, 1, surface.characteristic_length)
    fit = sp.fit_limit_surface(surface.wrench(twists), twists, slider=slider, seed=0)
    shown = fit._repr_html_()
    assert "poly4-cvx" in shown and "data:image/png;base64," in shown and "SOS-convex" in shown
    region = sp.stable_region(surface, sp.PushContact.on_edge(slider, 0, 0.05, 0.05, 0.9))
    assert "data:image/png;base64," in region._repr_html_() and " deg" in region._repr_html_()
    report = sp.diagnose(make_log())
    assert report._repr_html_().startswith("<iframe srcdoc=")


def test_what_holds_long_arrays_is_shown_in_a_line():
    problem = small_scene()
    result = sp.plan(problem, refinement_budget=0)
    trajectory = sp.sample_plan(problem, result)
    assert f"pusher=<{len(trajectory.t)} x 3 float64>" in repr(trajectory)
    log = make_log(count=16)
    pairs = log.pairs()
    assert repr(pairs).startswith(f"SlipPairs(wrenches=<{len(pairs.trials)} x 3 float64>")
    assert "<16 str>" in repr(sp.SlipPairs(np.zeros((1, 3)), np.zeros((1, 3)), [f"a long name {k}" for k in range(16)]))
    rig = sp.VirtualRig(problem.slider, problem.surface, 0.5, sp.Pusher.finger(0.005))
    done = rig.execute(sp.random_pushes(problem.slider, rig.pusher, 20, seed=0))
    shown = [trajectory, pairs, done, done.traces[0], sp.fit_limit_surface(pairs, model="gp")]
    assert all(len(repr(value)) < 600 for value in shown), [len(repr(value)) for value in shown]


def test_two_pictures_in_one_figure_have_a_legend_each():
    from matplotlib.figure import Figure

    problem = small_scene()
    result = sp.plan(problem, refinement_budget=0)
    figure = Figure(layout="constrained")
    for axes in figure.subplots(1, 2):
        plot_plan(problem, result, ax=axes)
        assert axes.get_legend() is not None
    assert not figure.legends
    alone = plot_plan(problem, result)
    assert alone.get_legend() is None and len(alone.figure.legends) == 1


def test_a_limit_surface_is_drawn_with_its_pokes():
    """Dots where the loads are; the surface goes through those of its own twists."""
    loads, twists = pairs(6)
    slider = triangle()
    fit = sp.fit_limit_surface(loads, twists, slider=slider, seed=0)
    np.testing.assert_array_equal(fit.wrenches, loads)
    np.testing.assert_array_equal(fit.twists, twists)
    drawn = plot_limit_surface(fit.surface, fit.wrenches, fit.twists)
    dots = next(c for c in drawn.collections if c.get_label() == "load of a poke")
    np.testing.assert_allclose(np.stack(dots._offsets3d, axis=-1), loads / (1, 1, fit.surface.characteristic_length))
    assert drawn.get_zlabel() == "tau/rho [N]"
    assert not plot_limit_surface(fit.surface).get_legend_handles_labels()[1]
    with pytest.raises(sp.InputError, match="6 and 5"):
        plot_limit_surface(fit.surface, loads, twists[:5])
    with pytest.raises(sp.InputError, match="3d"):
        plot_limit_surface(fit.surface, ax=Figure().subplots())
