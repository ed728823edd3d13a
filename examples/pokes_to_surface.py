"""From pokes to a limit surface: how many pokes does it take?

Simulates pokes on the built-in rig, fits three polynomial models to 5, 10, 20 and 40 of them and prints the mean angle between
predicted and measured twists on 200 other pokes.
"""

import numpy as np

import stablepush as sp
from stablepush.demo import demo_pokes
from stablepush.planar import angle_between, normalize_twist

log = demo_pokes(240)
loads, twists, _ = log.pairs()
rho = log.rig.slider.characteristic_length
test = slice(40, None)

print("pokes  " + "  ".join(f"{model:>10s}" for model in ("poly4-cvx", "poly4", "quadratic")))
for count in (5, 10, 20, 40):
    errors = []
    for model in ("poly4-cvx", "poly4", "quadratic"):
        fit = sp.fit_limit_surface(loads[:count], twists[:count], model, slider=log.rig.slider)
        slip = normalize_twist(fit.surface.twist(loads[test]), rho)
        errors.append(np.degrees(angle_between(slip, normalize_twist(twists[test], rho)).mean()))
    print(f"{count:5d}  " + "  ".join(f"{e:8.1f}°" for e in errors).rjust(10))
