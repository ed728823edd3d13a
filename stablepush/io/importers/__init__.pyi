from .mlab import triangle_slider as triangle_slider
from .registry import (
    Importer as Importer,
    Source as Source,
    find_sources as find_sources,
    import_source as import_source,
    importers as importers,
)
