"""Infrastructure for all layers: files, processes, seeds, names, versions, optional packages."""
