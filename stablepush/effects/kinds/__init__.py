"""One file an effect: what it is, what it does to a simulation, how it is found, and what to do about it.

A file that is added here is in the catalogue, at the place that its ``number`` says.
"""
