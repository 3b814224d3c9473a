"""Proofs about Evasion, whose noise has no bounds: chances of success and mean returns."""
