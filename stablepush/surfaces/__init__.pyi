from .gp import GaussianProcessSurface as GaussianProcessSurface, KernelSum as KernelSum
from .ideal import IdealLimitSurface as IdealLimitSurface
from .monomials import (
    UPPER as UPPER,
    bombieri_norms as bombieri_norms,
    gradient_rows as gradient_rows,
    hessian_operator as hessian_operator,
    monomial_exponents as monomial_exponents,
    monomial_index as monomial_index,
    monomials as monomials,
    substitution as substitution,
)
from .polynomial import FORCE_UNITS as FORCE_UNITS, PolynomialLimitSurface as PolynomialLimitSurface
from .protocol import LimitSurface as LimitSurface, check_surface as check_surface
from .registry import surface_kinds as surface_kinds, surface_of_kind as surface_of_kind
