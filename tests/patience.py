"""How long a test waits for what takes seconds on a quiet machine: a bound on hanging alone.

A machine that others use too takes twenty times as long, and no test may depend on that.
"""

ENOUGH = 600.0  # seconds
