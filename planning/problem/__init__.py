"""Problem construction: the ground problem of reaching a goal from a world, with only the parts that matter."""
