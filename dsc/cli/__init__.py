"""Commands `dsc plot`, `dsc runs` and `dsc view`; each imports its work when called, so that help stays light."""
