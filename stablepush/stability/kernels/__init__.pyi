from .chart import RIM as RIM, disc_from_twists as disc_from_twists
