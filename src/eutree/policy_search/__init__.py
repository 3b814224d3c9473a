"""Search among small trees: which to run next, and the evidence of its episodes; no environment."""
