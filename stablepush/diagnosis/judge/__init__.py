"""The verdict: misfit of the nominal and of the corrected simulation, where it lies, how probable each effect is."""
