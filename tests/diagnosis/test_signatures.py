"""What named effects give in each push, beside what is left without them; correlations of the estimates."""

import numpy as np
import pytest

import stablepush as sp
from stablepush.views import gap_html
from stablepush.views.plot import plot_residuals, plot_signatures

SLIDER = sp.Slider.centered([(0.0, 0.0), (0.15, 0.0), (0.0, 0.15)], mass=1.5)
FEET = sp.SupportDistribution([(-0.03, -0.03), (0.07, -0.03), (-0.03, 0.07)], [1, 1, 1])
NOISE = sp.Noise(0.02, 1e-4, 1e-3)


def diagnosed(*effects, pushes=40):
    slider = sp.Slider(SLIDER.vertices, mass=1.5, support=FEET)
    effects = [sp.parse_effect(words) for words in effects]
    rig = sp.VirtualRig(slider, sp.IdealLimitSurface(FEET, 4.0), 0.6, sp.Pusher.finger(0.005), effects, NOISE)
    return sp.diagnose(rig.execute(sp.random_pushes(slider, rig.pusher, pushes, seed=5), seed=6).log)


@pytest.fixture(scope="module")
def tilted():
    return diagnosed("tilt:slope=0.03/-0.01")


def test_a_slope_gives_what_is_left_without_it(tilted):
    assert tilted.named == ["tilt"]
    (signature,) = tilted.signatures
    assert (signature.effect, signature.unit) == ("tilt", "N")
    # a push that turns about a foot in most of its rows has no dot
    rows, told = np.asarray(tilted.row_names), np.asarray(tilted.determined)
    pushes = sum(told[rows == name].mean() >= 0.3 for name in np.unique(rows))
    assert 30 < pushes < 40 and signature.contribution.shape == signature.partial_residual.shape == (pushes, 3)
    # a slope pulls with m g times its size, and turns nothing about the centre of mass
    size = np.hypot(*tilted.ranking[0].estimates["slope"])
    forces = np.linalg.norm(signature.contribution[:, :2], axis=1)
    assert forces.max() <= 1.5 * 9.81 * size * (1 + 1e-6) and np.abs(signature.contribution[:, 2]).max() < 1e-9
    # it is what is left without it
    given, left = signature.contribution[:, :2].ravel(), signature.partial_residual[:, :2].ravel()
    large = np.abs(given) > 0.5 * np.abs(given).max()
    assert np.median(left[large] / given[large]) == pytest.approx(1.0, abs=0.1)
    assert (np.abs(left - given) < 0.3 * np.abs(given).max()).mean() > 0.9


def test_the_page_has_the_evidence_first_and_folds_the_details(tilted):
    page = gap_html(tilted)
    assert page.index("The evidence in one picture") < page.index("Look at it") < page.index("How large the gap is")
    folded = page[page.index("<details>") :]
    assert "tilt: slope x with tilt: slope y" in folded and "as large as this rig can have it" in folded
    # loads of the chosen push over its time
    assert '"signals"' in page and '"measured"' in page
    assert any("downhill, 0.03" in text.get_text() for text in plot_residuals(tilted).texts)


def test_estimates_are_those_that_are_fitted_together():
    report = diagnosed("drift:rate=-0.3", "latency:delay=0.08")
    assert sorted(report.named) == ["drift", "latency"]
    found = report.estimates
    assert {name.split(":")[0] for name in found.names} >= {"drift", "latency"}
    assert found.correlation.shape == (len(found.names),) * 2
    assert np.allclose(np.diag(found.correlation), 1.0) and np.allclose(found.correlation, found.correlation.T)
    assert np.abs(found.correlation).max() <= 1.0 and not found.at_bound
    # what to write into the mapping of an import
    assert any(step.startswith("latency: ") and "pose_delay: 0.08" in step for step in report.steps)
    # a delay shows in the clearances more clearly than in the loads
    units = {signature.effect: signature.unit for signature in report.signatures}
    assert units == {"drift": "N", "latency": "m"}
    delay = next(s for s in report.signatures if s.effect == "latency")
    assert np.corrcoef(delay.contribution[:, 0], delay.partial_residual[:, 0])[0, 1] > 0.95
    assert len(plot_signatures(report)) == 2


def test_a_log_without_a_gap_has_no_signature():
    report = diagnosed(pushes=20)
    assert report.verdict == "none" and report.signatures == []
    assert "The evidence in one picture" not in gap_html(report)
    with pytest.raises(sp.InputError, match="expected named effects"):
        plot_signatures(report)


def test_turns_about_a_foot_count_in_no_error_of_the_wrench():
    """Noise decides in which direction the friction of that foot acts: its load is no evidence."""
    drift = diagnosed("drift:rate=-0.2", pushes=15)
    assert drift.named == ["drift"]
    turning = ~drift.determined
    assert 0.05 < turning.mean() < 0.5 and any("turn about a support point" in note for note in drift.notes)
    left = np.linalg.norm(drift.residuals["after"][:, :2], axis=1)
    assert np.median(left[turning]) > 3 * np.median(left[~turning])
    wrench = next(entry for entry in drift.reductions if entry.channel == "wrench")
    assert wrench.within_noise and wrench.closed > 0.9
    (signature,) = drift.signatures
    off = np.abs(signature.partial_residual - signature.contribution)
    assert off.max() < 0.4 * np.abs(signature.contribution).max()
    page = gap_html(drift)
    assert (
        "Faint, and cut where they are long: slow rows and turns about a support point" in page
        and '"determined": 0' in page.replace('":0', '": 0')
    )
