"""Planners that string stable pushes together."""

from stablepush_planners.cor_lattice import plan_cor_lattice
from stablepush_planners.transfers import contact_graph

__all__ = ["contact_graph", "plan_cor_lattice"]
