"""Search among small trees: which to run next, and what its episodes showed; no environment."""
