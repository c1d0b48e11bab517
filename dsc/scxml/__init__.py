"""Reader and writer of SCXML documents (W3C Recommendation, 1 September 2015)."""
