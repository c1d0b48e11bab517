"""Commands `dsc plot`, `dsc runs` and `dsc view`; each imports its modules when called, so that `--help` is fast."""
