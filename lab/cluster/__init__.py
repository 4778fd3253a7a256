"""Work on a Dask cluster: workers that are checked, data in shared files, losses that are told."""
