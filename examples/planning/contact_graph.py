"""Draw the contacts of a scene, and the paths of the pusher between them.

python examples/planning/contact_graph.py [SCENE.json] [-o contacts.png]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import networkx as nx
import numpy as np
from matplotlib.figure import Figure
from stablepush_planners import contact_graph

import stablepush as sp
from stablepush.geometry.se2 import transform_points


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    scenes = Path(__file__).parents[1] / "scenes"
    parser.add_argument("scene", nargs="?", type=Path, default=scenes / "two-contacts.json")
    parser.add_argument("-o", "--output", type=Path, default=Path("contacts.png"))
    options = parser.parse_args()
    problem = sp.load_scene(options.scene)
    graph = contact_graph(problem)
    figure = Figure((6, 6), layout="constrained")
    axes = figure.subplots()
    axes.fill(*problem.slider.vertices.T, color="0.85", ec="0.3", label="slider")
    for node, frame in graph.nodes(data="frame"):
        if problem.pusher is not None:
            axes.fill(
                *transform_points(frame, problem.pusher).T, color="#0072B2", alpha=0.4, label="pusher" if node == 0 else None
            )
    for i, j, data in graph.edges(data=True):
        axes.plot(*data["path"][:, :2].T, color="#D55E00", lw=1)
        print(f"contact {i} to {j}: {1000 * data['length']:.0f} mm")
    places = {node: np.asarray(frame[:2]) for node, frame in graph.nodes(data="frame")}
    nx.draw_networkx_nodes(graph, places, ax=axes, node_size=200, node_color="white", edgecolors="black")
    nx.draw_networkx_labels(graph, places, ax=axes)
    axes.set(aspect="equal", xlabel="x in B [m]", ylabel="y in B [m]", title=f"contacts of {options.scene.stem}")
    axes.legend()
    figure.savefig(options.output, dpi=120)
    print(options.output)


if __name__ == "__main__":
    main()
