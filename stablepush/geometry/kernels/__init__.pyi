from .twist import way_of as way_of
