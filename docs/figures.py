"""Pictures of the gallery: the variable ``figure`` of each example, for the library's figures are no windows of pyplot's."""


def collect(block, block_vars, gallery_conf):
    from sphinx_gallery.scrapers import figure_rst

    figure = block_vars["example_globals"].get("figure")
    if figure is None or getattr(figure, "collected", False):
        return ""
    path = next(iter(block_vars["image_path_iterator"]))
    figure.savefig(path, dpi=110)
    figure.collected = True
    return figure_rst([path], gallery_conf["src_dir"])
