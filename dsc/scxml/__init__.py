"""Reader and writer of SCXML (W3C Recommendation, 1 September 2015)."""
