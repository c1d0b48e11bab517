"""Stand-alone controllers of plots: one Python module or one C99 file without this package (S3.4, S3.8)."""
