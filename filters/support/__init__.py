"""What every layer uses and no formula needs: files, processes, seeds, names, versions, optional packages."""
