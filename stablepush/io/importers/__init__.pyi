from .mlab import (
    Source as Source,
    find_sources as find_sources,
    import_source as import_source,
    triangle_slider as triangle_slider,
)
