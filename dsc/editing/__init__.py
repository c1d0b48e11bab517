"""Help for editors: findings, completion, hover, definitions and renames of plots, profiles and domains (S1.16)."""
