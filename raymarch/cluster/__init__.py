"""Films and large pictures on the workers of a Dask cluster. See docs/cluster.md.

`source` sends a scene, `worker` draws on a worker, `submit` hands out tasks, `connect` opens a cluster, `machines`
compares its workers, `frames` draws films and pictures, and `sweep` measures the settings of `raymarch cost`. Nothing
here imports Dask until a cluster is used.
"""
