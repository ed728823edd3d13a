"""Which effects explain a log: steps over the catalogue, judged on pushes that are left out."""
