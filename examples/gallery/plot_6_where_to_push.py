"""
Where to push?
==============

Contacts along the edges, with several spacings of the fingers, ranked by how tight a turn they can make,
whatever the pressure.
"""

import stablepush as sp
from stablepush.views.plot import plot_contacts, save_figure

slider = sp.Slider([(-0.06, -0.03), (0.06, -0.03), (0.06, 0.03), (-0.06, 0.03)])
ranked = sp.rank_contacts(slider, None, mu=0.6, measure="tightest-turn")
best = ranked[0]
print(f"{len(ranked)} contacts; the best on edge {best.edge}, fingers {1000 * best.width:.0f} mm apart")

figure = plot_contacts(slider, ranked, "tightest-turn").figure
save_figure(figure, "where_to_push.png")
