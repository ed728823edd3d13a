"""Files: JSON of sliders, contacts and surfaces, push logs as CSV or Parquet, maps of benchmarks.

Every reader checks what it reads and names file and place in its errors. Imports ``effects``, ``surfaces`` and below.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
