from .twist import exp_of as exp_of
