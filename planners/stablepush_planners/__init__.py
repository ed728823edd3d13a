"""Planners that string stable pushes together."""

from stablepush_planners.cor_lattice import plan_cor_lattice

__all__ = ["plan_cor_lattice"]
