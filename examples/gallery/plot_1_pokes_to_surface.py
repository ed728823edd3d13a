"""
How many pokes does it take?
============================

Pokes of the built-in rig are simulated; three polynomial models are fitted to the first 3, 5, 10, 20 and 40
of them, and judged by the angle between predicted and measured twists on 200 other pokes. Every fit is
given the slider: with outline and centre of mass known, three pokes nearly suffice for poly4-cvx. The error
that remains comes from the shape: the limit surface of three feet has flat facets, which a quartic rounds
off. Fitted to those 200 pokes themselves it is still 6.7° off.
"""

import matplotlib.pyplot as plt
import numpy as np

import stablepush as sp
from stablepush.demo import demo_pokes
from stablepush.geometry import angle_between, normalize_twist

log = demo_pokes(240)
loads, twists, _ = log.pairs()
slider = log.rig.slider
rho = slider.characteristic_length
test = slice(40, None)
truth = normalize_twist(twists[test], rho)

counts = (3, 5, 10, 20, 40)
figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
for model in ("poly4-cvx", "poly4", "quadratic"):
    errors = []
    for count in counts:
        fit = sp.fit_limit_surface(loads[:count], twists[:count], model, slider=slider)
        errors.append(
            np.degrees(angle_between(normalize_twist(fit.surface.twist(loads[test]), rho), truth).mean())
        )
    print(model, " ".join(f"{count}: {error:.1f}°" for count, error in zip(counts, errors, strict=True)))
    axes.plot(counts, errors, "o-", label=model)
axes.set(xscale="log", xlabel="pokes seen", ylabel="mean angle to measured twists (deg)", ylim=(0, None))
axes.set_xticks(counts, labels=[str(count) for count in counts])
axes.minorticks_off()
axes.legend()
figure.savefig("pokes_to_surface.png")
