"""Transforms: where frames are in each other, at each time; imports only `errors` and `facts`."""
