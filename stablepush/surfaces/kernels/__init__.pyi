from .h_inv import fit_scales as fit_scales, sum_loads_of_many as sum_loads_of_many, tilt_shares as tilt_shares
