"""SCXML in and out (W3C Recommendation, 1 September 2015)."""
